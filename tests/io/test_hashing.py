from __future__ import annotations

import pytest

from jeat_graph.data.errors import DataError
from jeat_graph.io.files.hashing import sha256_of


def test_the_checksum_is_that_of_the_standard(write):
    # FIPS 180-2, appendix B.1.
    expected = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
    assert sha256_of(write("a", "abc")) == expected


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(DataError, match="none"):
        sha256_of(tmp_path / "none")
