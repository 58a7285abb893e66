"""Archives: same files, same bytes; and none that is unsafe is unpacked."""

import os
import re
import shutil
import stat
import struct
import zipfile
from itertools import pairwise

import pytest

from galloping.publication import archive
from galloping.publication.archive import UnsafeArchive, is_plain, pack, unpack

FILES = {"a.csv": b"x,y\n1,2\n", "results/tables/b.csv": b"", "results/c.npz": bytes(range(256))}


def write(folder, files=FILES):
    for name, content in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)
    return folder


def read(folder):
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file()
    }


@pytest.fixture
def target(tmp_path):
    """An empty folder, alone in another one, so that what lands outside is seen."""
    folder = tmp_path / "outside" / "target"
    folder.mkdir(parents=True)
    return folder


def zipped(tmp_path, *entries):
    """A zip of (ZipInfo or name, content)."""
    path = tmp_path / "a.zip"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        for entry, content in entries:
            file.writestr(entry, content)
    return path


def refused(path, target, reason):
    with pytest.raises(UnsafeArchive, match=reason) as error:
        unpack(path, target)
    assert "\n" not in str(error.value) and str(error.value).startswith(f"{path}: ")
    return [path for path in target.parent.rglob("*") if path != target]


def test_files_come_back(tmp_path, target):
    pack(write(tmp_path / "folder"), tmp_path / "a.zip")
    unpack(tmp_path / "a.zip", target)
    assert read(target) == FILES


def test_same_files_same_bytes(tmp_path):
    folder = write(tmp_path / "folder")
    pack(folder, tmp_path / "a.zip")
    shutil.rmtree(folder)
    write(folder, dict(reversed(FILES.items())))
    for number, name in enumerate(FILES):
        os.utime(folder / name, (number, number))
        (folder / name).chmod(0o700)
    pack(folder, tmp_path / "b.zip")
    assert (tmp_path / "a.zip").read_bytes() == (tmp_path / "b.zip").read_bytes()


@pytest.mark.parametrize(
    "name",
    [
        "/etc/passwd",
        "../a",
        "a/../../b",
        "a/./b",
        "a//b",
        "a/",
        "C:/a",
        "C:a",
        "a\\b",
        "..\\a",
        "a\nb",
        ".ssh/config",
        "a/.snakemake",
        "-rf",
        "~/a",
        "a b",
        "naïve",
        "a\0b",
    ],
)
def test_names_that_leave_the_folder_or_hide_are_refused(tmp_path, target, name):
    assert not is_plain(name)
    path = tmp_path / "a.zip"
    with zipfile.ZipFile(path, "w") as file:
        entry = zipfile.ZipInfo("x")
        entry.filename = entry.orig_filename = name
        file.writestr(entry, "1")
        file.writestr("fine", "1")
    assert refused(path, target, "not a plain path") == []


def special(mode, name="a"):
    entry = zipfile.ZipInfo(name)
    entry.create_system = 3
    entry.external_attr = mode << 16
    return entry


@pytest.mark.parametrize(
    ("mode", "reason"),
    [
        (stat.S_IFLNK | 0o777, "a: a link"),
        (stat.S_IFDIR | 0o755, "a: not a regular file"),
        (stat.S_IFIFO | 0o644, "a: not a regular file"),
        (stat.S_IFCHR | 0o644, "a: not a regular file"),
    ],
)
def test_only_regular_files_are_unpacked(tmp_path, target, mode, reason):
    path = zipped(tmp_path, ("fine", "1"), (special(mode), "/etc/passwd"))
    assert refused(path, target, reason) == []


@pytest.mark.filterwarnings("ignore:Duplicate name")
@pytest.mark.parametrize(
    ("names", "reason"),
    [
        (("a", "a"), "a: given twice"),
        (("a/b.csv", "a/B.csv"), r"a/B\.csv: given twice"),
        (("a/b", "A/c"), "A: differs from a in upper and lower case only"),
        (("a", "a/b"), "a: both a file and a folder"),
    ],
)
def test_names_that_clash_are_refused(tmp_path, target, names, reason):
    path = zipped(tmp_path, *((name, "1") for name in names))
    assert refused(path, target, reason) == []


def test_a_bomb_is_refused_by_its_ratio(tmp_path, target):
    path = zipped(tmp_path, ("a", bytes(2 * archive.SMALL)))
    assert refused(path, target, "a: more than 200 times its size") == []


@pytest.mark.parametrize(
    ("limit", "value", "reason"),
    [("MAX_SIZE", 5, "6 bytes when unpacked; at most 5"), ("MAX_ENTRIES", 2, "3 entries; at mo")],
)
def test_limits_of_the_whole(tmp_path, target, monkeypatch, limit, value, reason):
    path = zipped(tmp_path, *((name, "12") for name in "abc"))
    unpack(path, tmp_path / "fine")
    monkeypatch.setattr(archive, limit, value)
    assert refused(path, target, reason) == []


def patched(path, name, offsets, form, value):
    """Overwrite a field in the local header and in the directory entry of a file."""
    content = bytearray(path.read_bytes())
    for signature, offset in zip((b"PK\3\4", b"PK\1\2"), offsets, strict=True):
        places = [match.start() for match in re.finditer(re.escape(signature), content)]
        start = next(
            place
            for place, following in pairwise([*places, len(content)])
            if name.encode() in content[place : min(following, place + 80)]
        )
        struct.pack_into(form, content, start + offset, value)
    path.write_bytes(content)
    return path


def test_a_bomb_that_lies_about_its_size_is_stopped_at_what_it_declared(tmp_path, target):
    path = zipped(tmp_path, ("bomb", bytes(50 * archive.SMALL)))
    patched(path, "bomb", (22, 24), "<L", 100)
    refused(path, target, "not a sound zip file")
    assert (target / "bomb").stat().st_size <= 100


def test_encrypted_and_oddly_compressed_files_are_refused(tmp_path, target):
    path = zipped(tmp_path, ("fine", "1"), ("a.csv", "12345"))
    assert refused(patched(path, "a.csv", (6, 8), "<H", 1), target, "a.csv: encrypted") == []
    lzma = zipfile.ZipInfo("a")
    lzma.compress_type = zipfile.ZIP_LZMA
    path = zipped(tmp_path, ("fine", "1"), (lzma, "12345"))
    assert refused(path, target, "a: compressed in another way") == []


def test_files_that_share_bytes_are_refused(tmp_path, target):
    path = zipped(tmp_path, ("a", bytes(1000)), ("b", bytes(1000)))
    content = bytearray(path.read_bytes())
    directory = content.rindex(b"PK\1\2")
    struct.pack_into("<L", content, directory + 42, 0)  # b begins where a does
    path.write_bytes(content)
    assert refused(path, target, "a: overlaps what follows it") == []


@pytest.mark.parametrize("harm", [lambda c: c[:-30], lambda c: b"", lambda c: b"no zip" * 100])
def test_what_is_no_zip_is_refused(tmp_path, target, harm):
    path = zipped(tmp_path, ("a", "1"))
    path.write_bytes(harm(path.read_bytes()))
    assert refused(path, target, "not a sound zip file") == []


def test_damaged_content_is_refused(tmp_path, target):
    path = zipped(tmp_path, ("a", bytes(range(256))))
    content = bytearray(path.read_bytes())
    content[40] ^= 1
    path.write_bytes(content)
    refused(path, target, "not a sound zip file")
