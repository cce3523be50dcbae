"""Tables in a Markdown file between markers."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.readme import fill_tables, update_readme
from jeat_graph.data.errors import DataError

TEXT = "# Title\n\n<!-- table: a -->\nold\n<!-- end -->\n\ntext\n<!-- table: b-c -->\n<!-- end -->\ntail\n"


def test_what_stands_between_the_markers_is_replaced():
    new, found = fill_tables(TEXT, {"a": "| x |\n", "b-c": "| y |"})
    assert found == ["a", "b-c"]
    assert "<!-- table: a -->\n\n| x |\n\n<!-- end -->" in new
    assert "old" not in new
    assert new.startswith("# Title\n\n")
    assert new.endswith("<!-- end -->\ntail\n")


def test_tables_that_were_not_measured_stay():
    new, found = fill_tables(TEXT, {"other": "| x |"})
    assert (new, found) == (TEXT, [])


@given(st.text(alphabet="ab|-\n \\1", max_size=40))
def test_filling_twice_is_filling_once(table):
    once, _ = fill_tables(TEXT, {"a": table})
    assert fill_tables(once, {"a": table})[0] == once


@pytest.mark.parametrize(
    "text", ["<!-- table: a -->\nno end\n", "<!-- table: a -->\n<!-- table: b -->\n<!-- end -->\n"]
)
def test_a_marker_without_end_is_refused(text):
    with pytest.raises(DataError, match="has no <!-- end -->"):
        fill_tables(text, {"a": "x", "b": "y"})


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(DataError, match=r"nowhere\.md: cannot be read"):
        update_readme(tmp_path / "nowhere.md", {})


def test_a_file_that_is_up_to_date_is_not_written(tmp_path):
    path = tmp_path / "README.md"
    path.write_text(TEXT)
    update_readme(path, {"a": "| x |"})
    before = path.stat().st_mtime_ns, path.stat().st_ino
    update_readme(path, {"a": "| x |"})
    assert (path.stat().st_mtime_ns, path.stat().st_ino) == before
