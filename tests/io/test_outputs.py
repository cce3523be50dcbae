"""Results never go where a file is in the way, nor over what they are made from."""

import pytest

from jeat_graph.data.errors import DataError
from jeat_graph.io.files.outputs import check_folder, check_keeps


def test_a_file_is_no_folder(tmp_path):
    (tmp_path / "run").write_text("")
    with pytest.raises(DataError, match="run: is a file; --out must be a folder"):
        check_folder(tmp_path / "run")


def test_a_folder_and_nothing_at_all_are_fine(tmp_path):
    check_folder(tmp_path)
    check_folder(tmp_path / "new")


def test_an_input_is_never_the_result_whatever_it_is_called(tmp_path):
    (tmp_path / "in.csv").write_text("")
    check_keeps([tmp_path / "in.csv"], tmp_path / "out.csv")
    with pytest.raises(DataError, match="choose another OUT"):
        check_keeps([tmp_path / "in.csv"], tmp_path / "x" / ".." / "in.csv", "OUT")
