"""What is asked of HDF5 itself is what h5py says."""

from pathlib import Path

import h5py
import numpy as np
import pytest

from draglag.store.items import attribute, attribute_sizes, links


def _text(padding: int) -> h5py.Datatype:
    kind = h5py.h5t.C_S1.copy()
    kind.set_size(8)
    kind.set_strpad(padding)
    return kind


VALUES = {
    "whole": np.int64(-3),
    "other order of bytes": np.array(7, ">i2"),
    "number": np.float64(0.1),
    "none": np.float64("nan"),
    "row": np.array([1.5, 2.5]),
    "text": np.array("µm".encode(), h5py.string_dtype("utf-8", 3)),
    "texts": np.array([b"x_mm", b"y"]),
    "text of any length": "Zoë",
    "empty": h5py.Empty("f8"),
    "yes or no": np.True_,
    "pair": np.array((1, 2.0), [("a", "i4"), ("b", "f8")]),
}


@pytest.fixture
def group(tmp_path: Path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        group = file.create_group("g")
        for key, value in VALUES.items():
            group.attrs[key] = value
        for name in ("STR_NULLTERM", "STR_NULLPAD", "STR_SPACEPAD"):
            space = h5py.h5s.create(h5py.h5s.SCALAR)
            made = h5py.h5a.create(group.id, name.encode(), _text(getattr(h5py.h5t, name)), space)
            made.write(np.array(b"a b", "S8"))
        yield group


def test_attributes_have_the_values_and_sizes_that_h5py_gives(group: h5py.Group) -> None:
    names = [name.decode() for name, _ in attribute_sizes(group.id)]
    assert names == sorted(group.attrs)
    for name, size in attribute_sizes(group.id):
        one, other = attribute(group.id, name), group.attrs[name.decode()]
        assert (type(one), repr(one)) == (type(other), repr(other)), name
        assert name == b"empty" or size == group.attrs.get_id(name.decode()).get_storage_size()  # no size, no answer


def test_links_that_lead_elsewhere_are_no_items(group: h5py.Group) -> None:
    group["soft"], group["external"] = h5py.SoftLink("/none"), h5py.ExternalLink("b.h5", "/")
    group["here"], group["hard"] = [1.0], group.file["/"]
    assert links(group.id) == [(b"external", False), (b"hard", True), (b"here", True), (b"soft", False)]
    assert links(group.id, 2) == [(b"external", False), (b"hard", True)]
