"""Tables of events in the layouts that people have give the same events, whatever wrote them."""

from __future__ import annotations

import gzip
import zipfile
from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy import io as scipy_io

from jeat_graph.cli.main import main
from jeat_graph.data.errors import DataError
from jeat_graph.data.events import EventArray
from jeat_graph.io.events import ascending, text_tables
from jeat_graph.io.events.layout import EventLayout
from jeat_graph.io.events.opening import open_events
from jeat_graph.io.events.stretches import open_stretches

#: .4 s from t = 2 s on over 640 x 360 px: a bar of 20 x 60 px that moves right at 200 px/s, and noise.
WIDTH, HEIGHT, COUNT, START_US, LENGTH_US = 640, 360, 6000, 2_000_000, 400_000


def bar() -> tuple[np.ndarray, ...]:
    rng = np.random.default_rng(0)
    t = np.sort(rng.integers(START_US, START_US + LENGTH_US, COUNT))
    edge = rng.integers(0, 2, COUNT)
    x = (200 + (t - START_US) // 5000 + 20 * edge).astype(int)
    y = rng.integers(150, 210, COUNT)
    noise = rng.random(COUNT) < 0.1
    x = np.where(noise, rng.integers(0, WIDTH, COUNT), x)
    y = np.where(noise, rng.integers(0, HEIGHT, COUNT), y)
    x[7], y[7], x[8], y[8] = WIDTH - 1, 0, 0, HEIGHT - 1
    return t, x, y, 1 - edge


T, X, Y, P = bar()
SIGN = np.where(P, 1, -1)


def lines(*columns: np.ndarray, fmt: str = "%d", sep: str = ",", header: str = "") -> str:
    text = "\n".join(sep.join(fields) for fields in zip(*(fmt_column(c, fmt) for c in columns), strict=True))
    return header + text + "\n"


def fmt_column(column: np.ndarray, fmt: str) -> list[str]:
    return [f"{value:.9f}" if isinstance(value, float) else fmt % value for value in column.tolist()]


def h5(path: Path, attrs: dict[str, object] | None = None, **items: object) -> None:
    with h5py.File(path, "w") as file:
        for name, value in items.items():
            file[name.replace("__", "/")] = value
        for name, value in (attrs or {}).items():
            file.attrs[name] = value


def records(*fields: tuple[str, str, np.ndarray]) -> np.ndarray:
    out = np.zeros(COUNT, dtype=[(name, kind) for name, kind, _ in fields])
    for name, _, values in fields:
        out[name] = values
    return out


def zipped(path: Path, *members: tuple[str, str]) -> None:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members:
            archive.writestr(name, content)


RPG = lines(T / 1e6, X, Y, P, sep=" ")
U16 = np.uint16
LAYOUTS = {
    "RPG text": lambda p: p.write_text(RPG),
    "RPG text with several blanks": lambda p: p.write_text(RPG.replace(" ", "   ")),
    "RPG text in zip": lambda p: zipped(p, ("a/events.txt", RPG), ("a/images.txt", "0.1 images/a.png\n")),
    "RPG text in gzip": lambda p: p.write_bytes(gzip.compress(RPG.encode())),
    "text with comment": lambda p: p.write_text("# t x y p\n" + RPG),
    "text with Windows line ends": lambda p: p.write_bytes(RPG.replace("\n", "\r\n").encode()),
    "CSV x,y,p,t": lambda p: p.write_text(lines(X, Y, P, T)),
    "CSV x,y,t,p": lambda p: p.write_text(lines(X, Y, T, P)),
    "CSV t,x,y,p": lambda p: p.write_text(lines(T, X, Y, P)),
    "CSV with names": lambda p: p.write_text(lines(T, X, Y, P, header="t,x,y,p\n")),
    "CSV with names in another order": lambda p: p.write_text(lines(P, Y, X, T, header="p,y,x,t\n")),
    "CSV with more columns": lambda p: p.write_text(lines(T, X, X, Y, P, header="t,x,age,y,p\n")),
    "CSV with a byte-order mark": lambda p: p.write_text("\ufeff" + lines(T, X, Y, P, header="t,x,y,p\n")),
    "CSV of words": lambda p: p.write_text(
        "\n".join(f"{t},{x},{y},{bool(q)}" for t, x, y, q in zip(T, X, Y, P, strict=True))
    ),
    "CSV with semicolons": lambda p: p.write_text(lines(T, X, Y, P, sep=";")),
    "MEVDT": lambda p: p.write_text(lines(T, X, Y, SIGN, header="timestamp,x,y,polarity\n")),
    "nanoseconds by name": lambda p: p.write_text(lines(T * 1000, X, Y, P, header="time_ns,x,y,p\n")),
    "milliseconds by name": lambda p: p.write_text(lines(T / 1e3, X, Y, P, header="time [ms],x,y,p\n")),
    "tonic": lambda p: npy(p, records(("t", "<i8", T), ("x", "<i2", X), ("y", "<i2", Y), ("p", "?", P))),
    "Metavision": lambda p: npy(
        p, records(("x", "<u2", X), ("y", "<u2", Y), ("p", "<i2", P), ("t", "<i8", T))
    ),
    "CARLA": lambda p: npy(
        p, records(("x", "<u2", X), ("y", "<u2", Y), ("t", "<i8", T * 1000 + 321), ("pol", "?", P))
    ),
    "big-endian records": lambda p: npy(
        p, records(("t", ">i8", T), ("x", ">i2", X), ("y", ">i2", Y), ("p", "i1", SIGN))
    ),
    "N x 4 in s": lambda p: npy(p, np.c_[T / 1e6, X, Y, P]),
    "N x 4 in µs": lambda p: npy(p, np.c_[T, X, Y, P]),
    "N x 4 in µs as floats": lambda p: npy(p, np.c_[X, Y, T, SIGN].astype(float)),
    "4 x N": lambda p: npy(p, np.c_[T, X, Y, P].T.copy()),
    "N x 4 by columns": lambda p: npy(p, np.asfortranarray(np.c_[T, X, Y, P])),
    "npz of columns in s": lambda p: npz(p, x=X, y=Y, t=T / 1e6, p=SIGN),
    "npz of columns in µs": lambda p: npz(p, x=X, y=Y, t=T, p=P),
    "npz of one array": lambda p: npz(p, events=np.c_[T, X, Y, P], other=np.zeros(3)),
    "npz by columns": lambda p: npz(p, arr_0=np.asfortranarray(np.c_[T, X, Y, P])),
    "MATLAB 5": lambda p: mat(p, x=X, y=Y, ts=T, pol=P),
    "MATLAB 5 structure": lambda p: mat(p, TD={"x": X, "y": Y, "p": SIGN, "ts": T}),
    "MATLAB 7.3": lambda p: mat73(p, x=X, y=Y, ts=T, pol=P),
    "v2e": lambda p: h5(p, events=np.c_[T, X, Y, P].astype(np.uint32)),
    "MVSEC": lambda p: h5(
        p, davis__left__events=np.c_[X, Y, T / 1e6, SIGN], davis__left__imu=np.zeros((9, 6))
    ),
    "e2vid": lambda p: h5(p, events__xs=X, events__ys=Y, events__ts=T / 1e6, events__ps=P.astype(bool)),
    "eTraM": lambda p: h5(p, events__x=X, events__y=Y, events__p=P.astype(np.int16), events__t=T),
    "M3ED": lambda p: h5(
        p, prophesee__left__x=X, prophesee__left__y=Y, prophesee__left__t=T, prophesee__left__p=P
    ),
    "DSEC in float seconds": lambda p: h5(p, events__x=X, events__y=Y, events__p=P, events__t=T / 1e6),
    "DSEC of -1 and 1": lambda p: h5(
        p, events__x=X, events__y=Y, events__p=SIGN.astype(np.int8), events__t=T
    ),
    "records in HDF5": lambda p: h5(
        p, events=records(("x", "<u2", X), ("y", "<u2", Y), ("p", "<i2", P), ("t", "<i8", T))
    ),
}


def npy(path: Path, array: np.ndarray) -> None:
    with path.open("wb") as file:
        np.save(file, array)


def npz(path: Path, **arrays: np.ndarray) -> None:
    with path.open("wb") as file:
        np.savez_compressed(file, **arrays)


def mat(path: Path, **variables: object) -> None:
    with path.open("wb") as file:
        scipy_io.savemat(file, variables, do_compression=True)


def mat73(path: Path, **variables: np.ndarray) -> None:
    """HDF5 behind a block of text, as MATLAB writes it; a vector has two dimensions there."""
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in variables.items():
            file[name] = values[None].astype(np.float64)
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(512))


def read(path: Path, size=None, layout=None) -> tuple[EventArray, object]:
    with open_events(path, size, layout) as reader:
        return EventArray.concatenate(list(reader.pieces())), reader


@pytest.mark.parametrize("name", LAYOUTS)
def test_every_layout_gives_the_same_events(tmp_path, name):
    path = tmp_path / "events.dat"  # files are told by what they are
    LAYOUTS[name](path)
    events, reader = read(path)
    for column, expected in (("t_us", T), ("x", X), ("y", Y), ("polarity", P)):
        np.testing.assert_array_equal(getattr(events, column), expected)
    assert reader.damage.notes() == []
    with open_events(path) as again:
        assert again.needed_size() == (WIDTH, HEIGHT)
        assert again.damage.notes() == [
            "the file does not say the size of its picture; 640 x 360 px, as far as its events reach, were "
            "taken; --event-size says another"
        ]


@pytest.mark.parametrize(
    "name", ["RPG text", "CSV x,y,p,t", "tonic", "npz of columns in s", "eTraM", "MATLAB 5"]
)
def test_every_command_reads_them_alike(tmp_path, capsys, name):
    path = tmp_path / "night"
    LAYOUTS[name](path)
    assert main(["events", "info", str(path)]) == 0
    out = capsys.readouterr().out
    assert f"picture: {WIDTH} x {HEIGHT} px (not declared; so far the events reach)\nevents: {COUNT}," in out
    assert main(["events", "convert", str(path), str(tmp_path / "o.raw")]) == 0
    assert "640 x 360 px, as far as its events reach, were taken" in capsys.readouterr().err
    np.testing.assert_array_equal(read(tmp_path / "o.raw")[0].x, X)
    boxes = [tmp_path / "from_table.csv", tmp_path / "from_raw.csv"]
    for source, out_path in zip((path, tmp_path / "o.raw"), boxes, strict=True):
        assert main(["detect", "--events", str(source), "--out", str(out_path)]) == 0
    assert boxes[0].read_bytes() == boxes[1].read_bytes()
    with open_stretches(path) as stretches:
        assert (stretches.size_px, stretches.duration_us) == ((WIDTH, HEIGHT), int(T[-1]) + 1)
        inside = (T >= 2_100_000) & (T < 2_200_000)
        np.testing.assert_array_equal(stretches.between(2_100_000, 2_200_000).x, X[inside])


def test_a_line_of_width_and_height_is_the_size(tmp_path):
    path = tmp_path / "e.txt"
    path.write_text("640 480\n" + RPG)
    events, reader = read(path)
    assert (reader.size_px, len(events)) == ((640, 480), COUNT)


def test_the_geometry_of_metavision_is_the_size(tmp_path):
    path = tmp_path / "e.csv"
    path.write_text("%geometry:1280,720\n" + lines(X, Y, P, T))
    events, reader = read(path)
    assert (reader.size_px, len(events)) == ((1280, 720), COUNT)


def test_times_since_1970_begin_with_a_whole_second(tmp_path):
    path = tmp_path / "dv.csv"
    since = 1_700_000_000_000_000
    path.write_text(lines(T + since, X, Y, P, header="timestamp,x,y,polarity\n"))
    events, reader = read(path)
    assert reader.origin_us == since + 2_000_000
    np.testing.assert_array_equal(events.t_us, T - 2_000_000)


def test_nanoseconds_since_1970(tmp_path):
    path = tmp_path / "e.npy"
    npy(path, np.c_[T * 1000 + 1_700_000_000_000_000_000, X, Y, P])
    events, reader = read(path)
    assert reader.origin_us == 1_700_000_002_000_000
    np.testing.assert_array_equal(events.t_us, T - 2_000_000)


SIZES = {
    "attributes": ({"width": np.int64(700), "height": np.int32(400)}, {}),
    "data sets": ({}, {"events__width": np.int64(700), "events__height": np.uint8(200)}),
    "data sets of length one": ({}, {"events__width": [700], "events__height": [400]}),
    "at the top": ({}, {"width": 700, "height": 400}),
    "geometry": ({"geometry": "700x400"}, {}),
    "height first": ({"sensor_resolution": (400, 700)}, {}),
    "M3ED": ({}, {"events__calib__resolution": [700, 400]}),
}


@pytest.mark.parametrize("where", SIZES)
@pytest.mark.parametrize("indexed", [True, False])
def test_the_size_is_found_wherever_it_stands(tmp_path, capsys, where, indexed):
    attrs, items = SIZES[where]
    path, out = tmp_path / "e.h5", tmp_path / "o.h5"
    more = {"ms_to_idx": np.searchsorted(T, 1000 * np.arange(2402))} if indexed else {}
    h5(path, attrs, events__x=X, events__y=np.minimum(Y, 199), events__p=P, events__t=T, **items, **more)
    expected = (700, 200 if where == "data sets" else 400)
    assert read(path)[1].size_px == expected
    with open_stretches(path) as stretches:
        assert stretches.size_px == expected
    assert main(["events", "convert", str(path), str(out)]) == 0
    events, reader = read(out)
    assert (reader.size_px, len(events)) == (expected, COUNT)


def test_a_size_that_was_assumed_loses_no_events(tmp_path, capsys):
    """DSEC's own files do not say that they have 640 x 480 px; a file of a larger camera is none of them."""
    path = tmp_path / "e.h5"
    index = np.searchsorted(T, 1000 * np.arange(2402))
    h5(path, events__x=X + 500, events__y=Y, events__p=P, events__t=T, ms_to_idx=index)
    said = (
        r"its events reach x = \d+, y = \d+, beyond the 640 x 480 px of DSEC; give it with --event-size WxH"
    )
    with pytest.raises(DataError, match=said):
        read(path)
    with open_stretches(path) as stretches, pytest.raises(DataError, match=said):
        stretches.between(2_000_000, 2_400_000)
    assert main(["events", "convert", str(path), str(tmp_path / "o.raw")]) == 2
    assert not (tmp_path / "o.raw").exists()
    assert len(read(path, (1280, 720))[0]) == COUNT


def test_one_event_far_outside(tmp_path, capsys):
    path = tmp_path / "e.h5"
    y = Y.copy()
    y[1234] = 33_014
    h5(path, events__x=X, events__y=y, events__p=P, events__t=T, events__width=WIDTH, events__height=HEIGHT)
    events, reader = read(path)
    assert (len(events), reader.damage.outside) == (COUNT - 1, 1)
    h5(path, events__x=X, events__y=y, events__p=P, events__t=T)
    assert main(["events", "info", str(path)]) == 0
    out = capsys.readouterr().out
    assert "picture: 640 x 360 px (not declared" in out
    assert "note: 1 events lie outside the picture and were left out" in out
    assert main(["events", "convert", str(path), str(tmp_path / "o.raw")]) == 2
    assert "single events lie as far out as x = 639, y = 33014" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["text", "npy", "h5"])
def test_blocks_in_disorder_are_sorted_and_it_is_said(tmp_path, name):
    order = np.argsort(Y, kind="stable")
    t, x, y, p = (column[order] for column in (T, X, Y, P))
    path = tmp_path / "e"
    if name == "text":
        path.write_text(lines(t, x, y, p, header="t,x,y,p\n"))
    elif name == "npy":
        npy(path, np.c_[t / 1e6, x, y, p])
    else:
        h5(path, events__x=x, events__y=y, events__p=p, events__t=t)
    events, reader = read(path)
    np.testing.assert_array_equal(events.t_us, T)
    assert sorted(zip(events.t_us, events.x, events.y, strict=True)) == sorted(zip(T, X, Y, strict=True))
    earlier = int((t < np.maximum.accumulate(t)).sum())
    assert reader.damage.notes() == [f"{earlier:,} events came after later ones and were put in order"]


def test_what_comes_too_late_to_be_sorted_is_refused_with_its_line(tmp_path, monkeypatch):
    monkeypatch.setattr(ascending, "SORT_ROWS", 1000)
    monkeypatch.setattr(text_tables, "BLOCK_BYTES", 10_000)
    path = tmp_path / "e.csv"
    path.write_text(lines(np.r_[T, T], np.r_[X, X], np.r_[Y, Y], np.r_[P, P], header="t,x,y,p\n"))
    with pytest.raises(DataError, match=rf"e.csv:{COUNT + 2}: its time lies .* sort the file by time first"):
        read(path)


def test_a_single_wrong_time_does_not_spoil_the_rest(tmp_path):
    t = T.copy()
    t[100], t[3000] = 2**40, 5
    path = tmp_path / "e.npy"
    npy(path, np.c_[t, X, Y, P])
    events, reader = read(path)
    expected = T.copy()
    expected[100], expected[3000] = T[99], T[2999]
    np.testing.assert_array_equal(events.t_us, expected)
    assert (reader.damage.leaps, reader.damage.held) == (1, 1)


WRONG = {
    "polarity": (
        lambda rows: rows.__setitem__((41, 3), "2"),
        "e.csv:43: its polarity is 2; it must be 0 or 1",
    ),
    "both": (lambda rows: rows.__setitem__((41, 3), "-1"), "e.csv:.*polarities are 0 .* -1"),
    "word": (lambda rows: rows.__setitem__((41, 1), "abc"), "e.csv:43: 'abc' is no number"),
    "nan": (lambda rows: rows.__setitem__((41, 0), "nan"), "e.csv:43: its t is no number"),
    "negative": (lambda rows: rows.__setitem__((41, 0), "-5"), "e.csv:43: its time is negative"),
}


@pytest.mark.parametrize("what", WRONG)
def test_a_wrong_value_is_named_with_its_line(tmp_path, what):
    spoil, said = WRONG[what]
    rows = np.c_[T, X, Y, P].astype("U24")
    spoil(rows)
    path = tmp_path / "e.csv"
    path.write_text("t,x,y,p\n" + "\n".join(",".join(row) for row in rows) + "\n")
    with pytest.raises(DataError, match=said):
        read(path)


@pytest.mark.parametrize(
    ("column", "value", "said"),
    [
        (3, 2, r"event 41: its polarity is 2; it must be 0 or 1"),
        (3, -1, r"event 0: polarities are 0 here and -1 elsewhere"),
        (0, np.nan, r"event 41: its t is no number"),
        (1, np.inf, r"event 41: its x is no number"),
        (0, -5, r"event 41: its time is negative"),
        (0, 1e19, r"event 41: its time is too large"),
    ],
)
def test_a_wrong_value_of_an_array_is_named_by_its_event(tmp_path, column, value, said):
    rows = np.c_[T, X, Y, P].astype(float)
    rows[0, 3], rows[41, column] = 0, value
    npy(tmp_path / "e.npy", rows)
    layout = EventLayout(columns=("t", "x", "y", "p"), time_unit="us")
    with pytest.raises(DataError, match=rf"e\.npy: {said}"):
        read(tmp_path / "e.npy", layout=layout)


@pytest.mark.parametrize("unit", ["s", "ms", "us"])
def test_a_whole_number_that_is_no_time_is_too_large_in_every_unit(tmp_path, unit):
    """In µs it would be beyond the numbers of a computer, and come out as any other."""
    rows = np.c_[np.arange(COUNT), X, Y, P]
    rows[41, 0] = 2**62 + 2**40
    npy(tmp_path / "e.npy", rows)
    layout = EventLayout(columns=("t", "x", "y", "p"), time_unit=unit)
    with pytest.raises(DataError, match=r"e\.npy: event 41: its time is too large"):
        read(tmp_path / "e.npy", layout=layout)
    rows[41, 0] = -(2**62) - 2**40
    npy(tmp_path / "e.npy", rows)
    with pytest.raises(DataError, match=r"e\.npy: event 41: its time is negative"):
        read(tmp_path / "e.npy", layout=layout)


@pytest.mark.parametrize(("first", "then"), [(0, -1), (-1, 0)])
def test_polarities_of_two_kinds_are_named_where_the_second_kind_begins(tmp_path, monkeypatch, first, then):
    monkeypatch.setattr(text_tables, "BLOCK_BYTES", 10_000)
    p = np.where(np.arange(COUNT) < 3000, first, 1)
    p[4000:] = then
    (tmp_path / "e.csv").write_text(lines(T, X, Y, p, header="t,x,y,p\n"))
    with pytest.raises(DataError, match=rf"e\.csv:4002: polarities are {then} here and {first} elsewhere"):
        read(tmp_path / "e.csv")


@pytest.mark.parametrize(("on", "off"), [("True", "False"), ("ON", "off"), ("+", "-"), ('"true"', '"false"')])
def test_polarity_may_be_said_in_words(tmp_path, on, off):
    rows = (f"{t},{x},{y},{on if p else off}" for t, x, y, p in zip(T, X, Y, P, strict=True))
    (tmp_path / "e.csv").write_text("t,x,y,p\n" + "\n".join(rows) + "\n")
    np.testing.assert_array_equal(read(tmp_path / "e.csv")[0].polarity, P)


def test_five_columns_without_names_are_left_to_the_user(tmp_path):
    (tmp_path / "e.csv").write_text(lines(T, X, Y, P, P))
    with pytest.raises(DataError, match=r"does not name its 5 columns, .* cannot be distinguished"):
        read(tmp_path / "e.csv")
    said = EventLayout(columns=("t", "x", "y", "p", "-"))
    np.testing.assert_array_equal(read(tmp_path / "e.csv", layout=said)[0].polarity, P)
    with pytest.raises(DataError, match="has 5 columns, but --event-columns names 4"):
        read(tmp_path / "e.csv", layout=EventLayout(columns=("t", "x", "y", "p")))


def test_a_single_event_is_a_recording(tmp_path):
    (tmp_path / "e.csv").write_text("t,x,y,p\n1700000000500000,3,4,1\n")
    events, reader = read(tmp_path / "e.csv")
    assert (events.t_us.tolist(), events.x.tolist(), events.y.tolist()) == ([500_000], [3], [4])
    assert reader.origin_us == 1_700_000_000_000_000


def test_blanks_and_tabs_may_be_mixed(tmp_path):
    rows = RPG.splitlines(keepends=True)
    mixed = (row.replace(" ", " \t", 1).replace(" ", "\t") for row in rows[9:])
    text = "".join([*rows[:9], *mixed])
    (tmp_path / "e.txt").write_text(text)
    events, _ = read(tmp_path / "e.txt")
    np.testing.assert_array_equal(events.t_us, T)
    np.testing.assert_array_equal(events.y, Y)


def test_a_line_without_an_end_is_refused_before_it_fills_the_memory(tmp_path, monkeypatch):
    monkeypatch.setattr(text_tables, "BLOCK_BYTES", 1000)
    head = "t,x,y,p\n" + "".join(f"{t},3,4,1\n" for t in range(1000, 9000))
    (tmp_path / "e.csv").write_text(head)
    assert len(read(tmp_path / "e.csv")[0]) == 8000
    (tmp_path / "e.csv").write_text(head + "9" * 5000)
    with pytest.raises(DataError, match=r"e\.csv:8002: has a line without an end"):
        read(tmp_path / "e.csv")


def test_a_missing_field_is_named_and_a_cut_end_is_a_note(tmp_path):
    path = tmp_path / "e.csv"
    text = lines(T, X, Y, P, header="t,x,y,p\n")
    path.write_text(text + "2400000,3")
    events, reader = read(path)
    assert len(events) == COUNT
    assert reader.damage.notes() == ["9 bytes at the end are no whole event: the file is cut off"]
    path.write_text(text + "2400000,3\n" + "2400001,3,4,1\n")
    with pytest.raises(DataError, match=rf"e.csv:{COUNT + 2}: 2 fields, but the first event has 4"):
        read(path)


def test_two_recordings_in_one_file_must_be_told_apart(tmp_path, capsys):
    path = tmp_path / "stereo.h5"
    sides = {
        f"prophesee__{side}__{name}": column
        for side in ("left", "right")
        for name, column in (("x", X), ("y", Y), ("t", T), ("p", P if side == "left" else 1 - P))
    }
    h5(path, **sides)
    assert main(["events", "info", str(path)]) == 2
    said = capsys.readouterr().err
    assert "2 recordings of events: prophesee/left, prophesee/right; name one with --event-stream" in said
    events, _ = read(path, layout=EventLayout(stream="prophesee/right"))
    np.testing.assert_array_equal(events.polarity, 1 - P)
    assert main(["events", "info", str(path), "--event-stream", "prophesee/left"]) == 0
    with pytest.raises(DataError, match="holds no events named 'up'"):
        read(path, layout=EventLayout(stream="up"))


def test_two_texts_in_a_zip_archive_must_be_told_apart(tmp_path):
    path = tmp_path / "e.zip"
    zipped(path, ("left_events.txt", RPG), ("right_events.txt", RPG))
    with pytest.raises(DataError, match=r"2 files that may hold events: left_events.txt, .*--event-stream"):
        read(path)
    assert len(read(path, layout=EventLayout(stream="right_events.txt"))[0]) == COUNT


def test_columns_and_unit_that_are_said(tmp_path, capsys):
    path = tmp_path / "e.csv"
    path.write_text(lines(X, T // 1000, P, Y, Y, header="a,b,c,d,e\n"))
    assert main(["events", "info", str(path)]) == 2
    assert "which of them is t, x, y, p? Say it with --event-columns" in capsys.readouterr().err
    options = ["--event-columns", "x,t,p,y,-", "--event-time-unit", "ms"]
    assert main(["events", "convert", str(path), str(tmp_path / "o.dat"), *options]) == 0
    events, _ = read(tmp_path / "o.dat")
    np.testing.assert_array_equal(events.t_us, T // 1000 * 1000)
    np.testing.assert_array_equal(events.y, Y)
    assert main(["events", "info", str(path), "--event-columns", "t,t,x,y"]) == 2
    assert "columns of events must be t, x, y and p once each" in capsys.readouterr().err


def test_python_objects_are_never_loaded(tmp_path):
    path = tmp_path / "e.npy"
    with path.open("wb") as file:
        np.save(file, np.array([{"t": 1}], dtype=object), allow_pickle=True)
    with pytest.raises(DataError, match="is a NumPy array that cannot be read"):
        read(path)


def test_arrays_that_are_cut_off_are_refused_in_one_line(tmp_path):
    for name in ("tonic", "npz of columns in µs", "MATLAB 5"):
        path = tmp_path / "e"
        LAYOUTS[name](path)
        path.write_bytes(path.read_bytes()[:-2000])
        with pytest.raises(DataError) as caught:
            read(path)
        assert "\n" not in str(caught.value)


def test_an_offset_leads_to_the_clock_of_the_frames(tmp_path):
    path = tmp_path / "e.h5"
    start = int(T[0])
    h5(
        path,
        events__x=X.astype(U16),
        events__y=Y,
        events__p=P,
        events__t=T - start,
        t_offset=np.int64(49_599_300_523),
    )
    events, reader = read(path)
    assert reader.t_offset_us == 49_599_300_523
    np.testing.assert_array_equal(events.t_us, T - start)


def test_float_seconds_beside_an_index_are_read(tmp_path):
    path = tmp_path / "e.h5"
    index = np.searchsorted(T, 1000 * np.arange(2402))
    h5(path, events__x=X, events__y=Y, events__p=P, events__t=T / 1e6, ms_to_idx=index)
    np.testing.assert_array_equal(read(path)[0].t_us, T)


def test_places_between_pixels_are_rounded_and_it_is_said(tmp_path):
    path = tmp_path / "e.npz"
    x = X.astype(float)
    x[5] += 0.3
    npz(path, x=x, y=Y, t=T, p=P)
    events, reader = read(path)
    np.testing.assert_array_equal(events.x, X)
    assert reader.damage.notes() == ["1 columns or rows lie between pixels and were rounded"]


def test_times_in_single_precision_that_cannot_tell_events_apart_are_refused(tmp_path):
    path = tmp_path / "e.npy"
    npy(path, np.c_[T / 1e6 + 40_000, X, Y, P].astype(np.float32))
    with pytest.raises(DataError, match=r"times in single precision, at least 0.00391 s apart"):
        read(path, layout=EventLayout(time_unit="s"))


def test_names_without_events_are_a_file_without_events(tmp_path, capsys):
    path = tmp_path / "e.csv"
    path.write_text("t,x,y,p\n")
    assert main(["events", "info", str(path)]) == 0
    assert "events: 0" in capsys.readouterr().out


@pytest.mark.parametrize("spoilt", ["not a zip at all", "encrypted"])
def test_archives_that_cannot_be_read(tmp_path, spoilt):
    path = tmp_path / "e.zip"
    zipped(path, ("events.txt", RPG))
    data = bytearray(path.read_bytes())
    if spoilt == "encrypted":
        central = data.index(b"PK\x01\x02")
        data[6] |= 1
        data[central + 8] |= 1
    else:
        del data[200:]
    path.write_bytes(bytes(data))
    with pytest.raises(DataError) as caught:
        read(path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["o.h5", "o.raw", "o.dat"])
def test_the_offset_to_the_frames_survives(tmp_path, capsys, name):
    path = tmp_path / "e.h5"
    h5(path, events__x=X, events__y=Y, events__p=P, events__t=T, t_offset=np.int64(77))
    assert main(["events", "convert", str(path), str(tmp_path / name)]) == 0
    assert "t_offset" not in capsys.readouterr().err
    assert read(tmp_path / name)[1].t_offset_us == 77
    assert main(["events", "info", str(tmp_path / name)]) == 0
    assert "clock: time 0 is 0.000077 s of the file's clock" in capsys.readouterr().out
