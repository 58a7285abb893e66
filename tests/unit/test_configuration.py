"""The configuration: what it accepts, and the one line it answers with where it does not."""

import json
import math
import re
from functools import reduce
from itertools import pairwise
from pathlib import Path

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from jsonschema import Draft202012Validator
from snakemake.utils import update_config

from galloping.configuration.keys import RENAMED
from galloping.configuration.load import clean_merged, load, load_files, plain, sort_keys
from galloping.configuration.schema import (
    TABLE_BEGIN,
    TABLE_END,
    leaves,
    schema,
    schema_for_editors,
    with_key_table,
)
from galloping.configuration.settings import Settings
from galloping.configuration.yaml_file import NESTING_MESSAGE, ConfigurationError, read
from galloping.identification.registry import BY_NAME as METHODS
from galloping.line import continuous
from galloping.line.galerkin import derive
from galloping.paper.unknowns import UNKNOWN_NAMES
from galloping.study.shown import departures
from galloping.tables.line_parameters import conductor, spacers

ROOT = Path(__file__).parents[2]
EDITOR = Draft202012Validator(json.loads(schema_for_editors()))
METHOD_NAMES = ", ".join(METHODS)
OF_DERIVATIVES = ", ".join(name for name, m in METHODS.items() if "derivative" in m.protocols)


def case(**sections):
    return {"cases": {"a": sections}}


def nested(path, value, name="a"):
    """The mapping in which a value stands at a key, `<name>` in it replaced."""
    keys = (name if part == "<name>" else part for part in reversed(path.split(".")))
    return reduce(lambda inner, key: {key: inner}, keys, value)


def over(*files):
    """Configuration files as Snakemake merges them: the last ones twice, and lists replaced."""
    whole = {}
    for part in (*files[1:], *files):
        update_config(whole, part)
    return whole


def complaint(mapping):
    with pytest.raises(ConfigurationError) as error:
        load(mapping)
    return str(error.value)


# --- what is accepted ---


def test_shipped_configuration_is_the_default_study_where_the_paper_stands():
    shipped, default = plain(load(read(ROOT / "config/config.yaml"))), plain(load({}))
    for case in shipped["cases"].values():  # inferred of the first line, assumed of the other
        del case["wind"], case["initial_state"]
    inferred = ("bundle", "damping")  # the same for both lines
    both = [{name: case.pop(name) for name in inferred} for case in shipped["cases"].values()]
    assert both[0] == both[1]
    for case in default["cases"].values():
        for name in (*inferred, "wind", "initial_state"):
            del case[name]
    for study in (shipped, default):  # winds and further settings about those of the study
        del study["sweeps"]["wind"], study["assessment"]["winds"]
        del study["assessment"]["open_parameters"]
    paper = shipped["identification"].pop("paper")
    assert paper["threshold"] and default["identification"].pop("paper")["threshold"] is None
    assert shipped == default


def test_smoke_changes_only_the_extent_of_the_study():
    config, own = read(ROOT / "config/config.yaml"), read(ROOT / "config/smoke.yaml")
    whole, small = plain(load(config)), plain(load(over(config, own)))
    for name in ("cases", "simulation", "trials", "recordings", "figures"):
        assert small[name] == whole[name]
    for name, values in whole["identification"].items():
        assert name == "methods" or small["identification"][name] == values
    assert set(own) == {"results", "reference", "measurement", "identification", "sweeps",
                        "assessment"}  # fmt: skip


def test_what_is_accepted():
    settings = load({"cases": {"windy": {"wind": {"speed": 16}}}, "figures": {"dpi": 300}})
    wind = settings.cases["windy"].wind
    assert (list(settings.cases), wind.speed, wind.air_density) == (["windy"], 16, 1.25)
    for folder in ("/tmp/x", "../x/results/reference", "mine"):
        assert load({"reference": folder}).reference == folder
    written = load({"measurement": {"replicates": "1e1", "seed": "12e4"}}).measurement
    assert (written.replicates, written.seed) == (10, 120000) and type(written.seed) is int
    ice = {"reading": "custom", "vertical": [0.4, 2, -4], "horizontal": ["3e0", 0, 0]}
    own = load(case(ice=ice, spacers={"positions": []})).cases["a"]
    assert (own.ice.horizontal, own.spacers.positions) == ((3, 0, 0), ())


@given(st.one_of(st.integers(1, 120), st.floats(0.1, 120)), st.sampled_from("eE"))
def test_numbers_are_numbers_however_they_are_written(value, letter):
    for written in (float(value), str(value), f"{value:.17e}".replace("e", letter)):
        speed = load(case(wind={"speed": written})).cases["a"].wind.speed
        assert speed == value and isinstance(speed, float)


@given(st.text().filter(lambda text: not re.fullmatch(r"[-+]?[0-9.]+([eE].*)?", text)))
def test_other_text_is_not_a_number(value):
    line = complaint(case(wind={"speed": value}))
    assert line.startswith("cases.a.wind.speed: ") and line.endswith("; must be 0.1..120 m/s")
    assert len(line.splitlines()) == 1


# --- what is refused, and how ---

CASE = "cases.a"
MEASURES = "assessment.measures.far"
NO_CASES = {"cases": {}}
CUSTOM = {"reading": "custom", "horizontal": [1, "x", 3]}
UNUSABLE = {"identification": {"methods": ["weak"]}, "measurement": {"protocols": ["derivative"]}}
LONG = {"kind": "published_terms", "cases": ["lorenz"], "durations": [12]}
FAR = {"kind": "spacers", "mass": 4, "positions": [9, 301]}
# where the mistake is, what is written there or the whole mapping, and words of its one line
REFUSED = [
    # unknown keys
    (f"{CASE}.releases", {"wide": {"q_w": 3}}, "unknown key; is now initial_states"),
    ("measurement.paper_draws", 20, "unknown key; is now paper_replicates"),
    ("assessment.open_parameters.release_vertical", [0.1], "unknown key; is now initial_vertical"),
    (f"{CASE}.wnd", {"speed": 3}, "unknown key", "'wind'"),
    (f"{CASE}.span", 3, "'cases.<name>.line.span'"),
    ("figures.zzz", 1, "unknown key", "allowed: dpi, font_size"),
    ("figures.3", {"figures": {3: 1}}, "unknown key", "allowed: dpi, font_size"),
    (r"figures.'a\nb'", {"figures": {"a\nb": 1}}, "unknown key", "allowed: dpi, font_size"),
    # wrong types
    ("configuration", [], "[] is not a section", "a mapping of results, reference, cases"),
    (f"{CASE}.line.span", "12 m", "'12 m' is text, not a number", "1..10000 m"),
    *((f"{CASE}.line.span", value, shown, "is not a number", "1..10000 m")
      for value, shown in ((True, "true"), (None, "null"), ([1], "[1]"))),
    *((f"{CASE}.line.span", value, "not finite", "1..10000 m") for value in (math.inf, "1e400")),
    ("measurement.replicates", 2.5, "2.5 is not a whole number", "a whole number 1..10000"),
    ("measurement.protocols", "state", "'state' is not a list", "one or more of derivative"),
    ("figures", None, "null is not a section (write {} for its defaults)", "dpi, font_size"),
    # names
    ("identification.methods", ["stlq"], "unknown method 'stlq'", "'stlsq'", METHOD_NAMES),
    (f"{CASE}.line.mode_shape", "irvin", "mode shape 'irvin'", "'irvine'?", "irvine, sine"),
    (f"{CASE}.ice.reading", 7, "unknown reading 7; allowed: swapped, milli, custom"),
    *((f"cases.{name}", {"cases": {name: {}}}, "not allowed as a name; must be at most 40 lower")
      for name in ("North", "3rd", "a-b", "_x", "a" * 41, 3)),
    # ranges
    (f"{CASE}.line.span", 0, "0 is not allowed; must be 1..10000 m"),
    (f"{CASE}.damping.vertical", 1, "must be >= 0 and < 1"),
    (f"{CASE}.wind.speed", 1e300, "1e+300 is not allowed", "0.1..120 m/s"),
    (f"{CASE}.line.tension", 1e308, "1e+308", "N, with a sag of at most a quarter of the span"),
    ("measurement.levels", [0, -0.1], "-0.1 is not allowed; each must be >= 0 and < 10"),
    ("measurement.levels", [], "[] is empty; must hold at least one"),
    ("assessment.open_parameters.threshold", 1, "must be a list of distinct numbers > 0"),
    ("measurement.levels", [0.1, "1e-1"], "0.1 is given twice; must be distinct"),
    ("measurement.levels", [0.1, 0.10000000000001], "0.10000000000001 and 0.1 agree", "distinct"),
    # folders
    *(("results", folder, repr(folder), "must be a relative path", "no part starting with '.'")
      for folder in ("", "/tmp/x", "../x", "a/../b", "a//b", "a b", ".git", "a\n", "{x}", "~/x")),
    ("results", "a" * 101, f"'{'a' * 56}... is not allowed", "at most 100 letters"),
    *(("reference", folder, repr(folder), "from the root or the working folder")
      for folder in ("", "a//b", "a b", "a/", "a\n", "{x}", "~/x", "<x>")),
    ("recordings.a.files", ["s p.csv"], "'s p.csv'", "each must be a path of letters, digits,"),
    ("recordings.a.files", ["a.csv", "/tmp"], "'/tmp' is a folder; must be a file"),
    ("recordings.a.mapping", nested("recordings.a", {"files": ["a.csv"], "mapping": "/tmp"}),
     "'/tmp' is a folder; must be a file"),
    *(("results", folder, repr(folder), "the project's own; must be another folder")
      for folder in ("config", "docs", "examples/a", "Workflow/x", "results/reference/a")),
    ("results", {"results": "mine/here", "reference": "mine"}, "in the folder of the reference"),
    # of a line
    (f"{CASE}.spacers.positions", [75, 300], "300 is beyond the span (300 m)", "> 0 and < 300 m"),
    (f"{CASE}.spacers.positions", [75, 75], "75 comes after 75; must be strictly increasing"),
    (f"{CASE}.line.tension", 100, "100 N gives a sag of 1655 m in a span of 300 m", ">= 2207 N"),
    (f"{CASE}.ice.horizontal", [1, 2, 3], "not allowed with reading 'swapped'", "null"),
    (f"{CASE}.ice.vertical", case(ice=CUSTOM), "null is not allowed", "a list of 3 numbers",
     f"\n{CASE}.ice.horizontal: 'x' is text, not a number; each must be -10000..10000"),
    (f"{CASE}.truth.model", "plate", "unknown model 'plate'; allowed: two_mode, continuous"),
    (f"{CASE}.truth.modes", 3, "is not allowed with model two_mode; must be left out"),
    ("sweeps.calm.values", {"sweeps": {"calm": {"parameter": "tension", "values": [500, 600, 10]}}},
     "500 N gives a sag of 331.1 m in a span of 300 m", "must be >= 2207 N"),
    ("sweeps.calm.values", {"sweeps": {"calm": {"parameter": "span", "values": [100, 5000, 100]}}},
     "25000 N gives a sag of 1839 m in a span of 5000 m", "or the span <= 3398 m"),
    (f"{CASE}.truth.antisymmetric", case(truth={"model": "continuous", "modes": 1,
     "antisymmetric": 0.2}), "0.2 is not allowed with 1 mode; must be 0, or modes 2 or more"),
    # of the study
    ("cases", NO_CASES, "there is none; there must be a case or a trial"),
    ("simulation.sampling_rate", "0.125e0", "0.125 gives 37.5", "300 s", "100..10000000"),
    ("simulation.sampling_rate", 0.335, "100.5 sampling intervals", "must be a whole number"),
    ("simulation.steady_window", [299.95, 300], "[299.95, 300]", "must have 10 or more"),
    ("simulation.steady_window", [200, 200], "no", "must be increasing, 0..300 s"),
    ("measurement.subsets.points", [1000, 50000], "50000 is larger", "(30001 samples)"),
    ("identification.methods", UNUSABLE, "cannot use", "protocol derivative", OF_DERIVATIVES),
    ("recordings.a.publish", nested("recordings.a", {"files": ["/a.csv"], "publish": True}),
     "'/a.csv' cannot be published; must be below the working folder"),
    ("recordings.a.case", nested("recordings.a", {"files": ["a.csv"], "case": "b"}),
     "'b' is no case; must be one of internal_resonance"),
    *(("sweeps.wind.values", [10, 12, step], f"[10, 12, {step}] is not a range", "2 to 1000 values")
      for step in (5, 0, -1)),
    ("sweeps.a.values",
     nested("sweeps.a", {"parameter": "damping_ratio", "values": [0.5, 1.5, 0.1]}),
     "1.5 as damping_ratio: input should be less than 1"),
    ("sweeps.wind.second", "tension", "'tension'", "null", "both"),
    ("sweeps.wind.second",
     nested("sweeps.wind", {"second": "wind_speed", "second_values": [1, 2, 1]}), "varied already"),
    (f"{MEASURES}.kind", "damper", "no other key; must be with position, coefficient"),
    (MEASURES, nested(MEASURES, FAR), "301 m is outside the span of internal_resonance"),
    (f"{MEASURES}.positions", nested(MEASURES, FAR | {"positions": []}), "is empty"),
    ("trials.a.samples", [500],
     "is no key of random_lines; its own keys: protocols, levels, durations"),
    ("trials.a.cases", ["some"], "unknown case 'some' of random_lines; allowed: all"),
    ("trials.a.methods", nested("trials.a", {"kind": "files", "methods": ["weak"]}),
     "'weak' is no method of files; allowed: maximum_likelihood, weak_gls"),
    ("trials.a.methods", nested("trials.a", {"kind": "long_and_steady", "methods": ["weak_gls"]}),
     "'weak_gls' is no method of long_and_steady; allowed: maximum_likelihood"),
    ("trials.a.methods", nested("trials.a", {"kind": "model_error", "methods": ["weak"]}),
     "['weak'] cannot use the wind of '9 modes, gusts 5 %, wind'; must have one of maximum_like"),
    ("trials", nested("trials.readings", {"kind": "paper", "cases": ["any motion"]}),
     "must have the case 'first reading'"),
    ("trials.a.durations", nested("trials.a", LONG), "12 is not allowed; of lorenz at most 10"),
]  # fmt: skip


@pytest.mark.parametrize(("key", "value", "said"), [(k, v, said) for k, v, *said in REFUSED])
def test_a_mistake_is_a_line_with_key_value_and_what_is_allowed(key, value, said):
    is_whole = isinstance(value, dict) and key.split(".")[0] in value
    line = complaint(value if is_whole or key == "configuration" else nested(key, value))
    assert line.startswith(f"{key}: ")
    assert len(line.splitlines()) == 1 + "".join(said).count("\n")
    for part in said:
        assert part in line


def test_every_problem_is_reported_at_once_and_many_are_a_few_lines():
    lines = complaint(
        case(line={"span": -3}, wnd=1) | {"figures": {"dpi": 20}, "measurement": {"seed": -1}}
    ).splitlines()
    keys = [f"{CASE}.line.span", f"{CASE}.wnd", "measurement.seed", "figures.dpi"]
    assert [line.partition(":")[0] for line in lines] == keys
    assert len(complaint({"measurement": {"levels": ["x"] * 3000}}).splitlines()) <= 21
    many = complaint({f"key_{i}": 1 for i in range(3000)}).splitlines()
    assert len(many) == 21 and many[-1] == "configuration: and 2980 more problems"


def test_a_file_or_broken_link_in_place_of_the_results_is_one_line(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("Makefile").touch()
    Path("lost").symlink_to("nowhere")
    for folder in ("Makefile", "Makefile/results", "lost", "lost/results"):
        what = f"{folder.split('/')[0]!r} is a file or a broken link"
        line = f"results: {what}; must be a folder, or not there"
        assert complaint({"results": folder}) == line


EXTREMES = (
    1e300, -1e300, 1e308, 1e-300, 5e-324, 10**400, 1e24, 0, -1, math.nan, -math.inf, "1e999",
)  # fmt: skip


def assert_finite(line):
    """All that is derived from a line is."""
    derived = derive(plain(line))
    assert all(map(math.isfinite, (*derived.coefficients.values(), *derived.quantities.values())))


def test_a_renamed_key_leads_to_one_that_exists():
    paths = [f"{path}." for path, _ in leaves()]
    for old, new in RENAMED.items():
        here = f"{old.rpartition('.')[0]}.{new}."
        assert any(path.startswith(here) for path in paths)
        assert not any(path.startswith(f"{old}.") for path in paths)


@pytest.mark.parametrize("value", EXTREMES, ids=repr)
def test_an_absurd_number_anywhere_is_refused_or_can_be_derived_from(value):
    for path, node in leaves():
        items = [value] * node.get("minItems", 1)
        try:
            settings = load(nested(path, items if node.get("type") == "array" else value))
        except ConfigurationError as error:
            assert all(line.startswith(path.split(".")[0]) for line in str(error).split("\n"))
        else:
            for one in settings.cases.values():
                assert_finite(one)


LIMITS = {
    path: st.sampled_from((node["minimum"], node["maximum"]))
    for path, node in leaves()
    if path.startswith("cases.") and "maximum" in node
    if not {"initial_states", "truth"} & set(path.split("."))
}


@given(st.fixed_dictionaries(LIMITS))
def test_a_line_at_the_limits_can_be_derived(values):
    parts = (nested(path, value)["cases"]["a"] for path, value in values.items())
    mapping = over({"spacers": {"positions": []}}, *parts)
    try:
        settings = load(case(**mapping))
    except ConfigurationError as error:
        assert "no shallow cable" in str(error)
    else:
        assert_finite(settings.cases["a"])


KEYS = st.one_of(st.none(), st.booleans(), st.integers(), st.floats(), st.text())
JUNK = st.recursive(
    KEYS,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(KEYS, inner, max_size=3),
    max_leaves=5,
)


@given(st.sampled_from([path for path, _ in leaves()]), KEYS | st.just("a"), st.booleans(), JUNK)
def test_any_value_anywhere_loads_or_is_refused_in_lines_that_name_a_key(path, name, deep, value):
    path = path if deep else path.rpartition(".")[0] or path
    try:
        load(nested(path, value, name))
    except ConfigurationError as error:
        for line in str(error).split("\n"):
            assert line.isprintable()
            assert line.partition(": ")[0].split(".")[0] in Settings.model_fields


# --- YAML files ---

LAUGHS = "".join(f"{b}: &{b} [{f'*{a}, ' * 8}]\n" for a, b in pairwise("abcdefgh"))
FILES = [
    ("", ": is empty; must be a mapping of keys"),
    ("- 1\n", ": [1] is not a mapping of keys"),
    ("cases:\n  a:\n    gravity: 9\n    wind: {}\n    gravity: 10\n",
     ":5: key 'gravity' is given twice, first in line 3"),
    ("a: {b: 1, b: 2}\n", ":1: key 'b' is given twice, first in line 1"),
    ("a: 1\nb: [1, 2\nc: 3\n", ":3: expected ',' or ']', but got ':'"),
    ("a:\n\tb: 1\n", ":2: found character '\\t' that cannot start any token"),
    ("a: 1\n--- \nb: 1\n", ":2: but found another document"),
    ("? [1]\n: 2\n", ":1: found unhashable key"),
    ("a: 2026-13-01\n", ":1: '2026-13-01' is no timestamp"),
    ("a: !!int x\n", ":1: 'x' is no int"),
    ("a: !!python/name:os.system\n", ":1: could not determine a constructor for the tag"),
    *((text, f": {NESTING_MESSAGE}") for text in (
        "a: &a [*a]\n", "a: &a {b: *a}\n", "a: " + "[" * 2000 + "]" * 2000,
        "a: &a [x, x, x, x, x, x, x, x]\n" + LAUGHS)),
    (b"a: \xff\n", ": is not UTF-8 text"),
    (None, ": No such file or directory"),
]  # fmt: skip


@pytest.mark.parametrize(("content", "said"), FILES, ids=range(len(FILES)))
def test_a_bad_file_is_one_line_with_its_name(tmp_path, content, said):
    path = tmp_path / "study.yaml"
    if content is not None:
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(ConfigurationError) as error:
        read(path)
    line = str(error.value)
    assert line.startswith(f"{path}{said}") and len(line.splitlines()) == 1


def test_merged_keys_may_be_overridden(tmp_path):
    path = tmp_path / "study.yaml"
    path.write_text("a: &a {x: 1, y: 2}\nb: &b {<<: *a, x: 3}\nc: {<<: *b, y: 4}\n")
    assert read(path)["c"] == {"x": 3, "y": 4}


# --- what leaves the configuration ---


def test_an_overriding_file_does_not_reorder_cases():
    own = {"cases": {"first": {}, "second": {"initial_states": {"one": {}, "two": {}}}}}
    ours = {
        "cases": {"third": {}, "second": {"initial_states": {"three": {}, "one": {}}, "gravity": 9}}
    }
    whole = over(own, ours)
    found = sort_keys(whole, [own, ours])
    assert found == sort_keys(whole, []) == whole
    assert list(found["cases"]) == ["first", "second", "third"] != list(whole["cases"])
    assert list(found["cases"]["second"]["initial_states"]) == ["one", "two", "three"]


def test_a_case_set_to_null_is_removed():
    alone = clean_merged({"cases": {"first": {}, "forth": None}}, [{"cases": {"forth": None}}])
    assert list(load(alone).cases) == ["first"]  # also where no other file describes it


def test_a_line_of_ones_own_is_studied_alone():
    files = [read(ROOT / f"config/{name}.yaml") for name in ("config", "own_line")]
    settings = load(clean_merged(over(*files), files))
    assert list(settings.cases) == ["my_line"]
    assert set(departures(settings).values()) == {"the study does not have it"}


def test_which_cases_are_judged():
    both = {"internal_resonance": "", "non_resonant": ""}
    assert departures(load({})) == both
    ours = {"wind": {"speed": 30}, "damping": {"vertical": 0.01}}
    ours |= {"initial_states": {"high": {"q_v": 2}}}
    tighter = {"line": {"tension": 36000}}  # the paper prints the tension of the first line alone
    cases = {"internal_resonance": ours, "non_resonant": tighter, "b": {}}
    assert departures(load({"cases": cases})) == both
    other = {"internal_resonance": {"line": {"tension": 26000}, "truth": {}}}
    assert departures(load({"cases": other})) == {
        "internal_resonance": "line.tension is 26000, where the paper has 25000",
        "non_resonant": "the study does not have it",
    }
    continuous = {"internal_resonance": {"truth": {"model": "continuous"}}}
    assert "continuous" in departures(load({"cases": continuous}))["internal_resonance"]


@pytest.mark.parametrize(
    ("changed", "reason"),
    [({"simulation": {"duration": 400}}, "simulation.duration is 400, where the paper has 300"),
     ({"simulation": {"sampling_rate": 200}}, "simulation.sampling_rate is 200, where the paper"),
     ({"simulation": {"steady_window": [100, 200]}}, "simulation.steady_window is [100.0, 200.0]"),
     ({"identification": {"degree": 4}}, "identification.degree is 4, where the paper has 3")],
)  # fmt: skip
def test_claims_are_not_judged_by_other_records_or_another_library(changed, reason):
    (said,) = set(departures(load(changed)).values())
    assert said.startswith(reason)


def test_files_are_judged_together_before_anything_is_written(tmp_path):
    files = ROOT / "config/config.yaml", tmp_path / "a.yaml", tmp_path / "b.yaml"
    files[1].write_text("reference: kept\ncases: {non_resonant: null}\n")
    files[2].write_text("results: mine\ncases: {internal_resonance: {wind: {speed: 14}}}\n")
    settings = load_files(files)
    assert settings.results == "mine" and list(settings.cases) == ["internal_resonance"]
    files[2].write_text("results: kept/new\n")
    with pytest.raises(ConfigurationError, match="'kept'"):
        load_files(files)


def test_settings_are_plain_values_that_give_the_same_study():
    settings = load(case(wind={"speed": 16}))
    assert json.loads(json.dumps(plain(settings))) == plain(settings)
    assert load(plain(settings)) == settings


def test_every_key_is_described():
    for path, node in leaves():
        assert node["description"] and {"default", "unit"} <= node.keys(), path
        assert node["unit"] or node.get("type") not in ("integer", "number"), path
        if path.startswith("cases."):
            assert node["provenance"] in ("printed", "derived", "assumed") and node["symbol"], path
    assert all(node["description"] for node in schema()["$defs"].values())


def test_parameters_carry_their_source():
    ice = {"reading": "custom", "vertical": [1, 2, 3], "horizontal": [4, 0, 0]}
    settings = load({"cases": {"paper": {}, "other": {"line": {"tension": 35000}, "ice": ice}}})
    rows = conductor(plain(settings)).set_index(["case", "symbol"])
    about = ["key", "value", "unit", "provenance"]
    assert rows.loc[("paper", "H"), about].to_list() == ["line.tension", 25000, "N", "printed"]
    assert rows.loc[("paper", "EA"), "note"] == "printed 3.0e4, read in kN"
    assert rows.loc["paper"].loc[["D", "beta_3"], "provenance"].to_list() == ["assumed", "derived"]
    changed = rows.loc[("other", "H"), ["value", "provenance", "note"]].to_list()
    assert changed == [35000, "assumed", "default 25000 (printed)"]
    assert rows.loc[("other", "beta_3"), "value"] == 3


def test_both_tables_together_hold_every_parameter():
    settings = plain(load(case(initial_states={"wide": {}}, truth={"model": "continuous"})))
    keys = {key for table in (conductor, spacers) for key in table(settings)["key"]}
    of_cases = (path.partition("cases.<name>.")[2] for path, _ in leaves())
    assert {key.replace("wide", "<name>") for key in keys} == {*filter(None, of_cases)}


# --- the reference ---


def test_the_key_table_is_up_to_date():
    text = (ROOT / "config/README.md").read_text(encoding="utf-8")
    assert with_key_table(text) == text  # else: make docs


SCHEMA = ROOT / "workflow/schemas/config.schema.json"


def test_the_schema_for_editors_is_up_to_date():
    assert SCHEMA.read_text(encoding="utf-8") == schema_for_editors()  # else: make docs


@pytest.mark.parametrize("file", sorted((ROOT / "config").glob("*.yaml")), ids=lambda f: f.stem)
def test_configuration_files_name_the_schema_and_keep_to_it(file):
    text = file.read_text(encoding="utf-8")
    place = re.match(r"# yaml-language-server: \$schema=(\S+)\n", text)[1]
    assert (file.parent / place).resolve() == SCHEMA
    EDITOR.validate(yaml.safe_load(text))


@pytest.mark.parametrize(
    "mistake",
    [
        "simulaton: {}", "simulation: {duration: long}", "simulation: {duration: 0}",
        "cases: {Upper: {}}", "cases: {a: {wind: {sped: 3}}}", "cases: 3",
        "identification: {methods: [sindy]}", "figures: {dpi: 1.5}", "sweeps: null",
    ],
)  # fmt: skip
def test_an_editor_marks_what_a_run_would_refuse(mistake):
    assert not EDITOR.is_valid(yaml.safe_load(mistake))
    with pytest.raises(ConfigurationError):
        load(yaml.safe_load(mistake))


def test_a_stale_key_table_is_mended_and_one_without_markers_refused():
    text = with_key_table(f"before\n{TABLE_BEGIN}\nold\n{TABLE_END}\nafter\n")
    assert text.startswith("before\n") and text.endswith("\nafter\n")
    assert "| `measurement.seed` | `20260130` | 1 | a whole number >= 0 |" in text
    with pytest.raises(ValueError, match="needs the two lines"):
        with_key_table("prose\n")


def test_settings_allow_what_there_is():
    """Settings name what they allow themselves: without the imports of what does it."""
    aerodynamics = dict(leaves())["cases.<name>.truth.aerodynamics"]["enum"]
    assert tuple(aerodynamics) == continuous.AERODYNAMICS
    assert set(plain(load({}))["assessment"]["open_parameters"]) == set(UNKNOWN_NAMES)
