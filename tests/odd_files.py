"""Files as instruments and spreadsheets write them, and what each must be answered.

All hold the same motion, q_v = sin(2.6 t) and q_w = 0.5 cos(2.6 t) m over 40 s, said in many ways:
`READ` must be read as that motion, `REFUSED` in one line with the cause, `DOUBTED` with a finding,
`NOTED` with a line.
"""

import gzip
import io
import pickle
import zipfile
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
from scipy.io import netcdf_file, savemat

from galloping.identification.findings import Code
from galloping.readers.array_files import MAX_TABLE_BYTES

TIME = np.arange(1000) / 25.0
V, W = np.sin(2.6 * TIME), 0.5 * np.cos(2.6 * TIME)
FALLEN = 0.05 * V + 0.4 * (TIME > 20.0) * (1.0 - np.exp(20.0 - TIME) * np.cos(2.6 * TIME - 52.0))


def measures(v: str, w: str) -> tuple[str, ...]:
    return "--states", "q_v,q_w,dq_v,dq_w", "--measure", f"q_v={v}", "--measure", f"q_w={w}"


BY_NAME, UNITS = measures("v", "w"), ("--unit", "m", "--unit", "t=s")
PLAIN, METRES = (*BY_NAME, *UNITS), (*BY_NAME, "--unit", "m")
STAMPS = pd.Timestamp("2026-01-31T12:00:00") + pd.to_timedelta(TIME, "s")


def table(header: str, *columns: object, mark: str = ",", decimal: str = ".") -> str:
    """A text table of columns: of numbers, or of text that stays as it is."""
    rows = [header]
    for cells in zip(*columns, strict=True):
        texts = (cell if isinstance(cell, str) else f"{cell:.6f}" for cell in cells)
        rows.append(mark.join(text.replace(".", decimal) for text in texts))
    return "\n".join(rows) + "\n"


def lines(header="t,v,w", mark=",", decimal=".", t=TIME, v=V, w=W) -> str:
    """A text table of t, v and w."""
    return table(header, t, v, w, mark=mark, decimal=decimal)


def commas(values: np.ndarray, digits: int = 6) -> list[str]:
    """Numbers with decimal commas."""
    return [f"{value:.{digits}f}".replace(".", ",") for value in values]


def coded(code: float) -> np.ndarray:
    """The vertical motion with a code in place of some samples."""
    values = V.copy()
    values[[3, 100, 101, 102, 500]] = code
    return values


def edited(text: str) -> str:
    """A text table whose row 57 is another."""
    rows = lines().splitlines()
    rows[56] = text
    return "\n".join(rows) + "\n"


def excel() -> bytes:
    """A zip archive, which a sheet of Excel is."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        archive.writestr("xl/workbook.xml", "<workbook/>")
    return buffer.getvalue()


def sheet(path: Path, **columns: object) -> None:
    """The second sheet of an Excel file, below a title."""
    with pd.ExcelWriter(path) as writer:
        pd.DataFrame([["Logger"], ["A17"]]).to_excel(writer, sheet_name="about", header=False)
        pd.DataFrame(columns).to_excel(writer, sheet_name="data", startrow=3, index=False)


def parquet(path: Path, **columns: np.ndarray) -> None:
    pd.DataFrame(columns).to_parquet(path)


def hdf5(path: Path, units: tuple[str, ...] = (), **columns: np.ndarray) -> None:
    with h5py.File(path, "w") as file:
        for name, values in columns.items():
            file[name] = values
        for name, unit in zip(columns, units, strict=False):
            file[name].attrs["units"] = unit


def netcdf(path: Path, **columns: np.ndarray) -> None:
    with netcdf_file(path, "w") as file:
        file.createDimension("n", len(TIME))
        for name, values in columns.items():
            file.createVariable(name, "d", ("n",))[:] = values


PACKED = np.append(V[:-1] * 1e6 - 250, -99999).astype("i4")  # the last sample is missing


def packed_hdf5(path: Path) -> None:
    hdf5(path, t=TIME, v=PACKED, w=W)
    with h5py.File(path, "a") as file:
        file["v"].attrs.update({"scale_factor": 1e-6, "add_offset": 2.5e-4, "_FillValue": -99999})


def filled_hdf5(path: Path) -> None:
    hdf5(path, t=TIME, v=coded(-99.9).astype("f4"), w=W)
    with h5py.File(path, "a") as file:
        file["v"].attrs["missing_value"] = -99.9


def packed_netcdf(path: Path) -> None:
    netcdf(path, t=TIME, w=W)
    with netcdf_file(path, "a") as file:
        packed = file.createVariable("v", "i", ("n",))
        packed[:] = PACKED
        packed.scale_factor, packed.add_offset, packed.missing_value = 1e-6, 2.5e-4, -99999


def mat(path: Path, **columns: object) -> None:
    savemat(path, columns)


def of(write: Callable, **columns: object) -> Callable:
    """A file that holds t, v and w, with other columns in their place or beside them."""
    return lambda path: write(path, **{"t": TIME, "v": V, "w": W} | columns)


def only(write: Callable, columns: dict[str, object]) -> Callable:
    """A file that holds these columns alone."""
    return lambda path: write(path, **columns)


def half(write: Callable) -> Callable:
    """The first half of a file that holds t, v and w."""

    def cut(path: Path) -> None:
        of(write)(path)
        path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])

    return cut


def workspace(path: Path) -> None:
    """A saved workspace: single numbers and a matrix beside the columns."""
    mat(path, t=TIME, v=V, w=W, fs=25, c__h=15.4, k__h=3529.0, data=np.column_stack([V, W]))


def structure_array(path: Path) -> None:
    """A structure array of MATLAB 7.3, the fields of which are references to other data sets."""
    with h5py.File(path, "w") as file:
        parts = [file.create_dataset(f"#refs#/{name}", data=V[None]) for name in "ab"]
        kept = file.create_dataset("data/y", (2, 1), h5py.ref_dtype)
        kept[:, 0] = [part.ref for part in parts]


def sparse_rows(path: Path) -> None:
    """A data set of 3.2 GB, of which nothing is written."""
    with h5py.File(path, "w") as file:
        for name in "tvw":
            file.create_dataset(name, (400_000_000,), "f8", chunks=(1000,), compression="gzip")


def too_large(path: Path) -> None:
    with path.open("wb") as file:
        file.truncate(MAX_TABLE_BYTES + 1)


def dated(style: str, moments: object = STAMPS) -> list[str]:
    return [format(moment, style) for moment in moments]


ENCODER = np.degrees(V) % 360.0  # the vertical motion as an angle that starts again after a turn
ROWS = [str(row) for row in range(1000)]
BY_PLACE = ("--time", "1", "--unit", "1=s", *measures("2[m]", "3[m]"))
LABVIEW = (
    "LabVIEW Measurement\t\nSeparator\tTab\nTime\t12:00:00.0\n***End_of_Header***\t\n\t\n"
    "Channels\t2\t\t\nDate\t2026/01/31\t2026/01/31\t\nTime\t12:00:00\t12:00:00\t\n"
    "Y_Unit_Label\tm\tmm\t\nX_Dimension\tTime\tTime\t\n***End_of_Header***\t\t\t\n"
)
Content = str | bytes | Callable[[Path], None]
NAMED = "time,vertical [m],horizontal [m]"
PREAMBLE = "Logger DL-2000\nSerial no. 12345\nStart; 31.01.2026\n\n"

# name of the file: content, options
READ: dict[str, tuple[Content, tuple[str, ...]]] = {
    "plain.csv": (lines(), PLAIN),
    "preamble_of_pairs.csv": ("Logger,DL-2000\nSerial,12345\n" + lines(), PLAIN),
    "preamble_of_as_many_cells.csv": ("Station,A17,left\nRate:,25,Hz\n,,\n" + lines(), PLAIN),
    "campbell.dat": (
        table('"TOA5","CR1000","1","2"\n"TIMESTAMP","RECORD","v","w"\n"TS","RN","m","m"\n'
              '"","","Avg","Avg"', [f'"{stamp}"' for stamp in STAMPS], ROWS, V, W),
        (*BY_NAME, "--time", "TIMESTAMP")),
    "unused_names_twice.csv": (table("t [s],v [m],w [m],status,status", TIME, V, W, V, W), ()),
    "unused_texts_twice.csv": (table("t [s],v [m],w [m],state,state", TIME, V, W, ["on"] * 1000,
        [str(k % 2) for k in range(1000)]), BY_NAME),
    "beside_a_wind.csv": (table("t [s],v [m],h [m],u [m/s],U [m]", TIME, V, W, W, W), ()),
    "chinese_accelerations.csv": (lines("时间[s],垂直加速度[m/s2],水平加速度[m/s2]"), ()),
    "altimeter.csv": (lines("time [s],laser altimeter vertical [m],orizzontale [m]"), ()),
    "frames_twice.csv": (table("frame,v [m],w [m]", ROWS[:700] + ROWS[699:], *(
        np.insert(each, 700, each[699]) for each in (V, W))), ("--rate", "25")),
    "filled.h5": (filled_hdf5, PLAIN),
    "single_precision.h5": (of(hdf5, v=coded(-999.9).astype("f4")), PLAIN),
    "named_months.csv": (lines(NAMED, t=dated("%d %b %Y %H:%M:%S.%f")), ()),
    "named_months_and_commas.csv": (lines(NAMED.replace(",", ";"), ";", ",",
        t=dated("%d-%b-%y %H:%M:%S.%f")), ()),
    "names_of_words.txt": (lines("  Time [s]   Vertical [m]   Horizontal [m]", "   "), ()),
    "true_minus_signs.csv": (lines("t [s];v [m];w [m]", ";", ",").replace(
        "-", "\N{MINUS SIGN}"), ()),
    "units_in_a_comment.csv": ("# a test\n# units: s, m, m\n" + lines("t,v,w"), BY_NAME),
    "receiver.txt": ("% program: A\n" + table("%  GPST  v(m)  w(m)", STAMPS.astype(str), V, W,
        mark="  "), ("--time", "GPST", *measures("v", "w"))),
    "below_a_percent_sign.txt": ("% of MATLAB\n" + lines("% t v w", " "), PLAIN),
    "two_rows_of_names.csv": (lines("Time [s],Displacement [m],\n,Vertical,Horizontal"),
        ("--unit", "m")),
    "units_beside_names.csv": (lines("Time,Displacement,\ns,Vertical [m],Horizontal [m]"), ()),
    "texts_first.csv": (table("sensor,time,vertical,horizontal\n,s,mm,m", ["A17"] * 1000, TIME,
        1e3 * V, W), ()),
    "row_of_gravities.csv": (lines("t,acc_v,acc_w\nSecond,G,G", v=V / 9.80665, w=W / 9.80665), ()),
    "row_of_units.csv": (lines("t,v,w\ns,m,m"), BY_NAME),
    "row_of_units_in_brackets.csv": (lines("t;v;w\n[s];[m];[m]", ";"), BY_NAME),
    "pasted_header.csv": (lines("t [s],v [m],w [m]"),
        (*measures("v [m]", "w [m]"), "--time", "t [s]")),
    "unit_of_time_told.csv": (lines("t,v [m],w [m]", t=1e3 * TIME), (*BY_NAME, "--time", "t [ms]")),
    "pasted_round_header.csv": (lines("t (s),v (m),w (m)"), measures("v (m)", "w (m)")),
    "millimetres.csv": (lines("t [ms],v [mm],w [cm]", t=1e3 * TIME, v=1e3 * V, w=1e2 * W), BY_NAME),
    "minus_9999.csv": (lines(v=coded(-9999)), PLAIN),
    "minus_999_25.csv": (lines(v=coded(-999.25)), PLAIN),
    "sixteen_bits.csv": (lines(v=coded(32767)), PLAIN),
    "two_codes.csv": (lines(v=np.where(TIME == 4.0, 9999, coded(-9999))), PLAIN),
    "campbell_nan.csv": (lines(v=["NAN" if k == 57 else f"{v:.6f}" for k, v in enumerate(V)]),
        PLAIN),
    "decimal_commas.csv": (lines("t;v;w", ";", ","), (*PLAIN, "--decimal", ",")),
    "decimal_commas_and_blanks.txt": (lines("t v w", "  ", ","), (*PLAIN, "--decimal", ",")),
    "tabs.tsv": (lines("t\tv\tw", "\t"), PLAIN),
    "savetxt_below_a_comment.txt": ("# a span, on a windy day\n" + lines("# t v w", " "), PLAIN),
    "windows.csv": (lines().replace("\n", "\r\n").encode("utf-8-sig"), PLAIN),
    "empty_last_column.csv": (table("t,v,w,", TIME, V, W, [""] * 1000), PLAIN),
    "unnamed_index.csv": (table(",t,v,w", ROWS, TIME, V, W), PLAIN),
    "dates.csv": (lines(t=STAMPS.astype(str)), METRES),
    "old_macintosh.csv": (lines().replace("\n", "\r"), PLAIN),
    "scientific.csv": (lines(t=[f"{t:.6E}" for t in TIME], v=[f"{v:+.6e}" for v in V]), PLAIN),
    "fixed_width.dat": (lines("      t     v    w", "      "), PLAIN),
    "unix_milliseconds.csv": (lines("t [ms],v [m],w [m]", t=1.7e12 + 1e3 * TIME), BY_NAME),
    "newest_first.csv": (lines(t=TIME[::-1], v=V[::-1], w=W[::-1]), PLAIN),
    "micrometres.csv": (lines("t [s],v [µm],w [m]", v=1e6 * V), BY_NAME),
    "comma_in_a_name.csv": (lines('t,"v, upper",w'), (*measures("v, upper", "w"), *UNITS)),
    "notes.csv": (table("t,v,w,note", TIME, V, W, ['"well, fine"'] * 1000), PLAIN),
    "units.parquet": (only(parquet, {"t [s]": TIME, "v [m]": V, "w (m)": W}), BY_NAME),
    "dates.parquet": (of(parquet, t=STAMPS), METRES),
    "durations.parquet": (of(parquet, t=pd.to_timedelta(TIME, "s")), METRES),
    "texts.parquet": (of(parquet, t=TIME.astype(str)), PLAIN),
    "dates.h5": (of(hdf5, t=STAMPS.astype("S").to_numpy()), METRES),
    "rows_and_columns.h5": (of(hdf5, t=TIME[None], v=V[:, None]), PLAIN),
    "german_dates.csv": (lines(t=dated("%d.%m.%Y %H:%M:%S.%f")), METRES),
    "american_dates.csv": (table('"#","Date Time, GMT+01:00","vertical, m","horizontal, m"', ROWS,
        dated("%m/%d/%y %I:%M:%S.%f %p"), V, W), ()),
    "over_midnight.csv": (table("Date,Time,vertical [m],horizontal [m]", ["31.01.2026"] * 1000,
        dated("%H:%M:%S.%f", STAMPS + pd.Timedelta("11:59:50")), V, W), ()),
    "decimal_commas_told.csv": (lines("t;v;w", ";", ","), PLAIN),
    "decimal_commas_and_blanks_told.txt": (lines("t v w", " ", ","), PLAIN),
    "decimal_commas_in_quotes.csv": (table("t,v,w", *(
        [f'"{cell}"' for cell in commas(each)] for each in (TIME, V, W))), PLAIN),
    "named_in_one_word.csv": (lines("unixtimestamp,vertical [m],horizontal [m]",
        t=STAMPS.astype(str)), ()),
    "two_clocks.csv": (table("time [s],uptime [s],vertical [m],horizontal [m]", TIME, TIME + 7.0, V,
        W), ()),
    "pressure_at_sea.csv": (table("time [s],v [m],w [m],pressure_msl [hPa]", TIME, V, W,
        [1013.25] * 1000), ()),
    "cut_off.txt": (lines("t v w", "  ")[:-10], PLAIN),
    "java_times.csv": (lines(NAMED, t=[s.time().isoformat()
        for s in STAMPS + pd.Timedelta("11:59:50")]), ()),
    "sixteen.csv": (lines().encode("utf-16"), PLAIN),
    "thirty_two.csv": (lines().encode("utf-32"), PLAIN),
    "bars.txt": (lines("t | v | w", " | "), PLAIN),
    "windows_1252.csv": (lines("Zeit [s];Vertikalweg [µm];Querweg w [m]", ";", ",",
        v=1e6 * V).encode("cp1252"), ()),
    "chinese.csv": (lines("时间（s）,垂直位移（mm）,水平位移（m）", v=1e3 * V), ()),
    "gb18030.csv": (lines("时间(s),垂直位移(m),水平位移(m)").encode("gb18030"), ()),
    "whole_seconds.csv": (lines(NAMED, t=[s.time().isoformat() for s in STAMPS]), ()),
    "plain_words.csv": (lines(NAMED, t=[s.isoformat() for s in STAMPS]), ()),
    "matlab_dates.csv": (lines(NAMED, t=dated("%d-%b-%Y %H:%M:%S.%f")), ()),
    "sentences.csv": (
        table('"Time, s";"Vertical displacement, mm";"Lateral displacement (cm)";Temp [°C]',
              TIME, 1e3 * V, 1e2 * W, TIME, mark=";"), ()),
    "with_slashes.csv": (lines("t / s,v / mm,w/cm", v=1e3 * V, w=1e2 * W), ()),
    "with_underscores.csv": (lines("time_ms,vertical_mm,horizontal_m", t=1e3 * TIME, v=1e3 * V),
        ()),
    "below_a_preamble.csv": (PREAMBLE + "Channel 1;top;left\n" + lines("Zeit;vert;horiz\ns;m;m",
        ";", ","), ()),
    "separator_said.csv": ("sep=;\n" + lines("t [s];vertical [m];horizontal [m]", ";"), ()),
    "column_twice.csv": (table("t [s],vertical [m],vertical [m],horizontal [m]", TIME, V, V, W),
        ()),
    "sheet.xlsx": (only(sheet, {"t [s]": TIME, "vertical [mm]": 1e3 * V, "horizontal [m]": W}), ()),
    "dates.xlsx": (only(sheet, {"Time": STAMPS, "q_v (m)": V, "q_w (m)": W}), ()),
    "commas.xlsx": (only(sheet, {"t [s]": TIME, "q_w [m]": W, "q_v [m]": commas(V)}),
        (*BY_NAME[:2], "--decimal", ",")),
    "units_of_velocity.csv": (lines("t [s],v [m],w [m]"), ("--states", "q_v,q_w,dq_v,dq_w")),
    "packed.nc": (packed_netcdf, PLAIN),
    "packed.h5": (packed_hdf5, PLAIN),
    "units.h5": (of(hdf5, units=("s", "mm", "m"), v=1e3 * V), BY_NAME),
    "times_of_a_day.parquet": (only(parquet,
        {"time": [s.time() for s in STAMPS], "q_v [m]": V, "q_w [m]": W}), ()),
    "no_unit_at_all.h5": (of(hdf5, units=(np.array([]),) * 3), PLAIN),
    "zones.csv": (lines(t=[f"{s}+01:00" for s in STAMPS]), METRES),
    "metres.csv": (lines("t [s],v [m],w [m]"), (*BY_NAME, "--unit", "v=metre")),
    "counts.csv": (lines("t [s],v [counts],w [m]", v=1e3 * V), (*BY_NAME, "--unit", "v=mm")),
    "matrix_beside.mat": (of(mat, picture=np.zeros((9, 9))), PLAIN),
    "workspace.mat": (workspace, PLAIN),
    "no_time.csv": (table("vertical [mm],horizontal [mm]", 1e3 * V, 1e3 * W), ("--rate", "25")),
    "frames.csv": (table("frame,vertical [mm],horizontal [m]", ROWS, 1e3 * V, W), ("--rate", "25")),
    "frames_by_unit.csv": (table("frame,vertical [mm],horizontal [m]", ROWS, 1e3 * V, W),
        ("--time", "frame", "--unit", "frame=0.04 s")),
    "no_time.mat": (only(mat, {"v": V, "w": W, "fs": 25}), (*METRES, "--rate", "25")),
    "pixels.csv": (lines("t [s],vertical [px],horizontal [m]", v=V / 0.00085),
        ("--unit", "vertical=0.85 mm")),
    "volts.csv": (lines("t [s],vertical [V],horizontal [m]", v=V / 0.0025),
        ("--unit", "vertical=2.5 mm")),
    "abbreviated.csv": (lines("Time (s),Vert. disp. phase A (mm),Lat. disp. phase A (mm)",
        v=1e3 * V, w=1e3 * W), ()),
    "more_abbreviated.csv": (table("t [s],Vert. pos. (cm),Hor. (cm),Long. disp. (cm)", TIME,
        1e2 * V, 1e2 * W, V), ()),
    "runs.csv": (lines("Time (s) Run #1,Vertical Position (m) Run #1,Trans. Position (mm) Run #1",
        w=1e3 * W), ()),
    "in_words.csv": (lines("time in s,vertical in mm,horizontal in m", v=1e3 * V), ()),
    "nanoseconds.csv": (lines("timestamp,vertical [m],horizontal [m]",
        t=(1769860800000000000 + (1e9 * TIME).astype(int)).astype(str)),
        ("--unit", "timestamp=ns")),
    "serial_days.csv": (lines("time,vertical [m],horizontal [m]",
        t=[f"{46053.5 + t / 86400:.12f}" for t in TIME]), ("--unit", "time=d")),
    "labview.txt": (LABVIEW + lines("X_Value\tv\tw\tComment", "\t", w=1e3 * W),
        (*measures("v", "w"), "--unit", "X_Value=s")),
    "labview.lvm": (LABVIEW + lines("X_Value\tv\tw\tComment", "\t", w=1e3 * W),
        (*measures("v", "w"), "--unit", "X_Value=s")),
    "motion_capture.csv": (
        table("Format Version,1.23,Take Name,Take 1\n,,Marker,Marker,Marker\n,,a,a,a\n,,1,1,1\n"
              ",,Position,Position,Position\nFrame,Time (Seconds),X,Y,Z", ROWS, TIME, W, V, TIME),
        (*measures("Y", "X"), "--unit", "m")),
    "motion_capture_units.csv": (
        table("Trajectories\n25\n,,span:mid,,\nFrame,Sub Frame,X,Y,Z\n,,mm,mm,mm", ROWS,
              ["0"] * 1000, 1e3 * W, 1e3 * V, TIME), (*measures("Y", "X"), "--rate", "25")),
    "catman.asc": (
        "HBM_CATMAN_DATAFILE_40\t5010\t3\t0\t\nT0 =\t31.01.2026 12:00:00\n"
        "NAME\tZeit\tWeg vertikal\tWeg horizontal\nUNIT\ts\tmm\tm\n"
        + lines("COMMENT\t\t\t", "\t", ",", v=1e3 * V), ()),
    "row_of_dates.csv": (lines("31.01.2026,31.01.2026,31.01.2026\nTime,Vertical,Horizontal\nDouble,"
        "Double,Double\ns,m,m"), ()),
    "units_above_names.csv": (lines("s,mm,mm\nTime,Vertical,Horizontal", v=1e3 * V, w=1e3 * W), ()),
    "oscilloscope.csv": (table("X,CH1,CH2,Start,Increment\nSequence,Volt,Volt,0,0.04", ROWS, V, W,
        [""] * 1000, [""] * 1000), ("--rate", "25", *measures("CH1[m]", "CH2[m]"), "--unit", "m")),
    "row_names_of_r.txt": ("t v w\n" + "".join(f"{k + 1} {row}\n" for k, row in
        enumerate(lines(mark=" ").splitlines()[1:])), PLAIN),
    "two_lines_of_a_name.csv": (lines('"Time\n[s]","Vertical\n[mm]","Lateral\n[m]"', v=1e3 * V),
        ()),
    "trailing_tab_of_names.txt": (lines("t [s]\tv [m]\tw [m]\t", "\t"), BY_NAME),
    "headless.txt": (lines("", " ")[1:], BY_PLACE),
    "headless_below_a_comment.txt": ("# on a windy day\n" + lines("", "\t", ",")[1:], BY_PLACE),
    "encoder.csv": (lines("t [s],v [deg],w [rad]", v=ENCODER), ("--states", "x,y", "--measure",
        "x=v", "--measure", "y=w")),
    "radians.csv": (lines("t [s],v,w", v=np.radians(ENCODER)), ("--states", "x,y", "--measure",
        "x=v[rad]", "--measure", "y=w[1]")),
}  # fmt: skip

# name of the file: content, options, what the refusal says
REFUSED: dict[str, tuple[Content, tuple[str, ...], tuple[str, ...]]] = {
    "commas_of_thousands.csv": (lines("t [s];v [m];w [m]", ";", v=commas(1.5 + V, 3)), BY_NAME,
        ("row 2, column 'v': '1,500'", "say --decimal ,", "without the comma if it separates")),
    "points_of_thousands.csv": (table("t [s];v [mm];w [m]", commas(TIME),
        [f"{1.5 + v:.3f}" for v in V], commas(W), mark=";"), (*BY_NAME, "--decimal", ","),
        ("row 2, column 'v': '1.500' has a point, which separates thousands",)),
    "switch.csv": (lines(v=[str(v > 0.0) for v in V]), PLAIN,
        ("column 'v'", "true and false, and no measured motion")),
    "day_or_month.csv": (lines("time,v,w",
        t=[f"0{1 + k // 500}/05/2026 12:00:{k / 100 % 10:09.6f}" for k in range(1000)]), METRES,
        ("row 2, column 'time'", "day or month")),
    "two_digits_of_a_year.csv": (lines("time,v,w", t=dated("%d-%m-%y %H:%M:%S.%f",
        STAMPS + pd.Timedelta("11:59:50"))), METRES, ("row 2, column 'time'", "day or month")),
    "milliseconds_without_zeros.csv": (lines("time,v,w", t=[f"{stamp:%H:%M:%S}."
        f"{stamp.microsecond // 1000}" for stamp in STAMPS]), METRES,
        ("row 3, column 'time': '12:00:00.40' is among", "write milliseconds as three digits")),
    "texts.mat": (of(mat, v=np.array(["0,5"] * 1000)), PLAIN, ("column 'v': '0,5' is not",)),
    "names_again.csv": (lines() + lines(), PLAIN,
        ("row 1002, column 't': 't' is not a number; where names", "cut the file into two")),
    "dates_in_words.csv": (lines(t=["noon"] * 1000), METRES,
        ("row 2, column 't': 'noon'",)),
    "states_only.csv": (lines("t,q_v,q_w"), ("--states", "q_v,q_w,x", *UNITS),
        ("no column 'x'", "--measure STATE=COLUMN")),
    "two_clocks.csv": (table("cam time [s],v [m],acc time [s],a_w [m/s^2]", TIME, V, 1.25 * TIME,
        W), (), ("'cam time' and 'acc time'", "39.96 and 49.95",)),
    "late_clock.csv": (table("cam time [s],v [m],acc time [s],a_w [m/s^2]", TIME, V, TIME + 3.0, W),
        (), ("'cam time' and 'acc time' begin 3 apart: bring",)),
    "clocks_without_units.csv": (table("Time,Vertical (m),Time.1,Horizontal (m)", TIME, V,
        TIME + 0.7, W), ("--unit", "Time=s"), ("'Time' and 'Time.1' begin 0.7 apart",)),
    "two_verticals.csv": (table("t [s],v [m],v [m]", TIME, V, W), (),
        ("two columns are named 'v'",)),
    "axes.csv": (table("t [s],u [m],v [m],w [m]", TIME, TIME, V, W), (),
        ("column 'u' does not say what it measures", "--measure")),
    "height.csv": (table("t [s],E [m],N [m],h [m]", TIME, W, V, V), (),
        ("column 'E' does not say what it measures",)),
    "receiver.csv": (table("time,lon,lat,height,hMSL,hAcc,vAcc", TIME, W, V, V, V, W, V), (),
        ("does not say what it measures",)),
    "no_dates.parquet": (only(parquet, {"time": pd.to_datetime([None] * 1000), "q_v [m]": V}), (),
        ("column 'time' is empty",)),
    "other_time.csv": (lines("when,v,w"), METRES, ("say --time 'when'",)),
    "no_time.csv": (table("v [m],w [m]", V, W), (), ("no column of times", "--time")),
    "channels.csv": (lines("t [s],ch1 [m],ch2 [m]"), (),
        ("column 'ch1'", "--write-map", "--measure 'q_v=ch1'")),
    "two_places.csv": (lines("t [s],left vertical [m],right vertical [m]"), (),
        ("'left vertical' and 'right vertical'",)),
    "winds.csv": (lines("t [s],vertical wind [m/s],horizontal wind [m/s]"), (),
        ("vertical or horizontal",)),
    "units_in_cells.csv": (lines("t [s],vertical [m],horizontal [m]", v=[f"{v:.4f} m" for v in V]),
        (), ("row 2, column 'vertical': '0.0000 m'",)),
    "damaged.xlsx": (excel(), PLAIN, ("no xlsx file",)),
    "sheet.csv": (excel(), PLAIN, ("an Excel sheet", "name the sheet .xlsx")),
    "old.xls": (b"\xd0\xcf\x11\xe0", PLAIN, ("files .xls are not read", "CSV", ".xlsx")),
    "nothing_but_commas.csv": (lines("t,v,w", ",", ","), PLAIN,
        ("3 cells, row 2 has 6", "say --decimal ,")),
    "points_read_as_commas.csv": (lines(), (*PLAIN, "--decimal", ","),
        ("commas",)),
    "other_column.csv": (lines("t,u,w"), PLAIN, ("no column 'v'", "it has 't', 'u', 'w'")),
    "headers_as_states.csv": (lines("t [s],q_v [m],q_w [m]"), ("--states", "q_v [m],q_w [m]"),
        ("'q_v [m]' is not a name", "--measure")),
    "position.csv": (lines(), ("--states", "q_v", "--measure", "q_v=v@abc", *UNITS),
        ("position 'abc'",)),
    "large.csv": (too_large, PLAIN, ("large.csv: ", "more than")),
    "folder.csv": (Path.mkdir, PLAIN, ("folder.csv: ", "not a file")),
    "absent.csv": (lambda path: None, PLAIN, ("absent.csv: ", "no such file")),
    "empty.csv": ("", PLAIN, ("the file is empty",)),
    "blank.csv": ("\n\n", PLAIN, ("no header",)),
    "no_rows.csv": ("t,v,w\n", PLAIN, ("no rows",)),
    "huge.csv": (edited("2.2,1e308,2"), PLAIN, ("1e+308",)),
    "clock.csv": (lines() + "0.0,77,1\n", PLAIN, ("has a time that was there before",)),
    "deep.csv": (table("t,v,w,note", TIME, V, W, ["fine" * 20] * 1000).encode()
                 + b"0,1,2,\x8d\x81\n", PLAIN, ("byte 0x8d is no text in UTF-8",)),
    "short.mat": (of(mat, v=V[:9]), PLAIN, ("column 'v' has 9 rows, the times 't' have 1000",)),
    "pickle.csv": (pickle.dumps({"t": TIME}), PLAIN, ("pickle",)),
    "unit_of_time.csv": (lines("t [s],v [s],w [m]"), BY_NAME, ("column 'v': unit 's'",)),
    "units_differ.csv": (lines("t [s],v [m],w [m]"), (*BY_NAME, "--unit", "v=mm"),
        ("'v' is in m by the file and in mm by the mapping",)),
    "units_of_time_differ.csv": (lines("t [s],v [m],w [m]"), (*BY_NAME, "--unit", "t=ms"),
        ("'t' is in s by the file and in ms by the mapping",)),
    "units_of_time_differ_told.csv": (lines("t [s],v [m],w [m]"), (*BY_NAME, "--time", "t [ms]"),
        ("'t' is in s by the file and in ms by the mapping",)),
    "unit_unknown.csv": (lines("t [s],v [furlong/],w [m]"), BY_NAME, ("column 'v': unit",)),
    "no_unit.csv": (lines("t [s],v,w [m]"), BY_NAME, ("column 'v' has no unit", "--unit v=m")),
    "units_in_capitals.csv": (lines("time (S),Vertical (MM),acc_horizontal_g"), (),
        ("--unit 'time (S)=s' --unit 'Vertical (MM)=mm' --unit acc_horizontal_g=g if",)),
    "units_behind_names.csv": (lines("t [s],disp_v_in,Lateral_Pos_M"), (),
        ("--unit disp_v_in=in --unit Lateral_Pos_M=m if",)),
    "unit_behind_a_name.csv": (lines("t [s],vertical_mm,w [m]"), ("--measure", "q_v=vertical_mm"),
        ("--unit vertical_mm=mm if",)),
    "volts_in_brackets.csv": (lines("t [s],101 <Vertical> (VDC),w [m]"), (),
        ("'VDC' is no unit", "--unit '101 <Vertical> (VDC)=2.5 mm'")),
    "gravity.csv": (lines("t [s],acc vertical,acc horizontal", v=1.0 + 0.1 * V), (),
        ("--unit 'acc vertical=g' --unit 'acc horizontal=g' if",)),
    "no_units.csv": (table("time,vertical,horizontal,wind speed", TIME, V, W, W),
        ("--input", "U=wind speed"),
        ("add --unit time=s --unit vertical=m --unit horizontal=m --unit 'wind speed=m/s', or")),
    "capitals.csv": (lines("TIME [S],VERTICAL [M],HORIZONTAL [M]"), (),
        ("column 'VERTICAL'", "'M' is no unit",)),
    "more_cells.csv": (edited("2.2,1,2,3,4"), PLAIN, ("row 57 has 5 cells, the header 3",)),
    "blank_cell.txt": (lines("t v w", "  ", v=["" if k == 55 else f"{v:.6f}" for k, v in
        enumerate(V)]), PLAIN, ("row 57 has 2 cells, the header 3; write missing samples as NaN",)),
    "unclosed.csv": (edited('2.2,"1,2'), PLAIN, ("row 57: a quotation mark is not closed",)),
    "footer.csv": (lines() + "END OF FILE\n", PLAIN, ("row 1002, column 't': 'END OF FILE'",)),
    "thousands.csv": (edited('2.2,"1,234.5",2'), PLAIN, ("row 57", "'1,234.5' is not")),
    "headless.csv": (lines().partition("\n")[2], (),
        ("1 to 3", "--time 1 --unit 1=s --measure 'q_v=3 [m]'")),
    "one_column.csv": ("v\n" + "\n".join(f"{v:.6f}" for v in V), PLAIN, ("one column",)),
    "packed.csv.gz": (gzip.compress(lines().encode()), PLAIN, ("files .gz are not read",)),
    "packed.csv": (gzip.compress(lines().encode()), PLAIN, ("gzip archive; unpack it",)),
    "named_wrongly.csv": (of(parquet), PLAIN, ("a Parquet file; name it .parquet",)),
    "page.csv": ("<!DOCTYPE html><html>Please log in</html>", PLAIN, ("a web page",)),
    "matrix.mat": (only(mat, {"data": np.column_stack([TIME, V, W])}), PLAIN,
        ("vector", "data (1000 x 3)")),
    "structure.mat": (only(mat, {"data": {"t": TIME, "v": V}}), PLAIN,
        ("vector", "save -struct")),
    "two_names.csv": (lines("t,v,v"), PLAIN, ("two columns are named 'v'",)),
    "infinite.csv": (edited("2.2,inf,2"), PLAIN, ("row 57, column 'v': inf is no measure",)),
    "matrix.h5": (only(hdf5, {"data": np.column_stack([TIME, V, W])}), PLAIN,
        ("vector", "data (1000 x 3)")),
    "text.parquet": (lines(), PLAIN, ("cannot be read", "no parquet file")),
    "cut.h5": (half(hdf5), PLAIN, ("cannot be read",)),
    "cut.parquet": (half(parquet), PLAIN, ("cannot be read",)),
    "constant.csv": (lines(v=0 * V), PLAIN, ("'v' is 0 throughout",)),
    "zeros.csv": (lines(v=["-", *["0.0"] * 999]), PLAIN, ("'v' is 0 throughout",)),
    "short.csv": (lines(t=TIME[:50], v=V[:50], w=W[:50]), PLAIN, ("50 rows are fewer than",)),
    "equal.csv": (lines(w=V), PLAIN, ("'v' and 'w'",)),
    "pixels.csv": (lines("t [s],vertical [px],horizontal [m]"), (),
        ("'vertical'", "pixel is no length",)),
    "pixels_said.csv": (lines("t [s],v [pixel],w [m]"), BY_NAME, ("'pixel' is no length",)),
    "volts.csv": (lines("t [s],Vertical Displacement [V],horizontal [m]"), (),
        ("'Vertical Displacement'", "unit 'V'")),
    "quote.csv": (lines('t [s],"Vertical ["",]",horizontal [m]'.replace(",]", "]")), (),
        ("'Vertical'", "'\"' is no unit")),
    "counts.csv": (lines("t [s],vertical [counts],horizontal [m]"), (), ("'counts' is no unit",)),
    "inches.csv": (lines("t;vertical;horizontal\ns;Zoll;m", ";"), (), ("'Zoll' is no unit",)),
    "other_order.csv": (lines("t [s],vertical velocity [m/s^2],horizontal [m]"), (),
        ("'vertical velocity'", "unit 'm/s^2'")),
    "tower_of_powers.csv": (lines("t [s],v [m**9**9**9],w [m]"), BY_NAME, ("cannot be read",)),
    "range_of_sensor.csv": (lines("t [s],v [50 mm],w [m]"), BY_NAME, ("is a number of units",)),
    "frames.csv": (table("frame,vertical [m]", ROWS, V), (),
        ("'frame' counts samples", "--rate 25")),
    "rate_beside_times.csv": (lines("t [s],v [m],w [m]"), (*BY_NAME, "--time", "t", "--rate", "25"),
        ("column 't' has the unit s",)),
    "rate_of_no_count.csv": (lines(), (*PLAIN[:-2], "--time", "t", "--rate", "25"),
        ("row 3, column 't': 0.04",)),
    "accelerations.csv": (table("time,accel_x,accel_y,accel_z", TIME, 1e3 * V, W + 9806.65, W), (),
        ("--measure 'ddq_v=accel_z [mm/s^2]'",)),
    "run.csv": (table("Time (s) Run #1,Position (m) Run #1", TIME, V), (),
        ("--measure 'q_v=Position Run #1'",)),
    "days.csv": (lines("time,vertical [m],horizontal [m]",
        t=[f"{46053.5 + t / 86400:.12f}" for t in TIME]), (), ("--unit time=d",)),
    "since_1970.csv": (lines("time,vertical [m],horizontal [m]", t=1.7e12 + 1e3 * TIME), (),
        ("--unit time=ms",)),
    "hours_without_colons.csv": (lines("time,vertical [m],horizontal [m]",
        t=dated("%H%M%S.%f", STAMPS + pd.Timedelta("45s"))), (), ("column 'time'", "HHMMSS")),
    "millimetres.csv": (lines("time [s],vertical,horizontal [m]", v=500 * V), (),
        ("--unit vertical=mm",)),
    "input.csv": (table("t [s],y [m],input", TIME, V, W), ("--states", "y", "--input", "u=input"),
        ("--unit input=1",)),
    "workspace.mat": (workspace, (*BY_NAME[:2], "--measure", "q_v=data"),
        ("no column 'data'", "unlike data (1000 x 2), fs = 25, c__h = 15.4")),
    "rate_in_workspace.mat": (only(mat, {"v": V, "w": W, "fs": 50}), (), ("--rate 50",)),
    "structure_array.mat": (structure_array, PLAIN, ("the file holds data/y (2 x 1)",)),
    "sparse.h5": (sparse_rows, PLAIN, ("GB of arrays are more than",)),
    "wide.csv": (",".join("abc" for _ in range(10_001)) + "\n" + ("1," * 10_000 + "1\n") * 3, PLAIN,
        ("10001 columns are more than 10000",)),
    "rows_of_names.csv": (table("Marker,Marker,Marker\nPosition,Position,Position\nX,X,X", TIME, V,
        W), (), ("rows 1, 2, 3", "keep one")),
    "coarse_clock.csv": (lines(t=np.floor(TIME)), PLAIN, ("coarse", "say --rate")),
}  # fmt: skip

# name of the file: content, options, column, row and code of the doubt
DOUBTED: dict[str, tuple[Content, tuple[str, ...], str, int, Code]] = {
    "huge.csv": (lines(v=3e11 * V), PLAIN, "v", 2, Code.UNIT_UNLIKELY),
    "thousandths.csv": (lines("t [s],v [mm],w [mm]"), BY_NAME, "v", 2, Code.UNIT_UNLIKELY),
    "milliseconds.csv": (lines(t=1e3 * TIME), PLAIN, "v", 2, Code.TIME_UNIT_UNLIKELY),
    "minutes.csv": (lines(t=TIME / 60), PLAIN, "v", 2, Code.TIME_UNIT_UNLIKELY),
    "clipped.csv": (lines(v=np.clip(V, -0.3, 2)), PLAIN, "v", 36, Code.CLIPPED),
    "moved.csv": (lines(v=V + 0.5 * (TIME > 20.0)), PLAIN, "v", 503, Code.CHANNEL_JUMPS),
    "ice_falls.csv": (lines(v=FALLEN), PLAIN, "v", 509, Code.MEAN_MOVES),
    "sign.csv": (table("t [s],v [m],acc_v [m/s^2],w [m]", TIME, V, 6.8 * V + W, W), (),
        "acc_v", 2, Code.SIGN_UNLIKELY),
    "swapped.csv": (lines(v=0.01 * W, w=V), PLAIN, "w", 2, Code.COLUMNS_SWAPPED),
    "coarse.csv": (lines(v=np.round(V, 1)), PLAIN, "v", 2, Code.RESOLVED_COARSELY),
}  # fmt: skip

# name of the file: content, options, what `inspect` notes
NOTED: dict[str, tuple[Content, tuple[str, ...], tuple[str, ...]]] = {
    "codes.csv": (lines(v=coded(-9999)), PLAIN, ("column 'v': 5 samples of -9999",)),
    "fill.csv": (lines(v=coded(1e20)), PLAIN, ("column 'v': 5 samples of 1e+20",)),
    "preamble.csv": (PREAMBLE + lines(), PLAIN, ("3, from row 1 on",)),
    "word.csv": (edited("2.2,OVERFLOW,0"), PLAIN, ("column 'v': 1 cells of 'OVERFLOW'",)),
    "twice.csv": (table("t [s],v [m],v [m],w [m]", TIME, V, V, W), (), ("column 'v'", "twice")),
    "gravity.csv": (lines("t [s],acc_v [g],w [m]"), (), ("ddq_v", "-9.81 m/s^2 to 9.81 m/s^2")),
    "averaged.csv": (lines("t [s],mid [m],left [m]", w=0.7 * V), ("--measure", "q_v=mid",
        "--measure", "q_v=left"), ("columns 'mid', 'left' are averaged as q_v: they have no",)),
    "not_used.csv": (table("t [s],vertical [m],w [m],Temp [°C]", TIME, V, W, W), (),
        ("not used: Temp",)),
    "encoder.csv": (lines("t [s],v [deg],w [m]", v=ENCODER),
        ("--states", "x,q_w,dq_w", "--measure", "x=v", "--measure", "q_w=w"),
        ("column 'v'", "after 360, 33 times")),
    "line_break.h5": (only(hdf5, {"t [s]": TIME, "vertical [m]": V, "a\n**ok**: \x1b[31m": W}), (),
        ("not used: a **ok**: [31m;",)),
    "sheets.xlsx": (only(sheet, {"t [s]": TIME, "q_v [m]": V}), (),
        ("of 2 sheets the longest (of equal ones the first), 'data', was read",)),
    "complex.mat": (of(mat, z=1j * V), PLAIN, ("z (1 x 1000, complex)",)),
    "stuck.csv": (lines(v=np.where(TIME > 20.0, V[500], V)), PLAIN,
        ("column 'v': 499 samples", "from row 503 on")),
}  # fmt: skip


def written(path: Path, content: Content) -> Path:
    """The file of a content."""
    if callable(content):
        content(path)
    else:
        path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path
