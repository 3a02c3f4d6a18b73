"""Notes on drawings that are read, but hardly as they were meant."""

from pathlib import Path

import ezdxf

from receptance import drawing


def _holder(path: Path, *, units: int, bore_layer: str) -> None:
    document = ezdxf.new(units=units)
    space = document.modelspace()
    space.add_lwpolyline([(0, 0), (0, 20), (80, 20), (80, 0)], dxfattribs={"layer": "NOCUT"})
    space.add_lwpolyline([(0, 6), (40, 6), (40, -6), (0, -6)], close=True, dxfattribs={"layer": bore_layer})
    document.saveas(path)


def test_a_part_of_two_metres_may_have_another_unit(tmp_path: Path) -> None:
    _holder(tmp_path / "inch.dxf", units=1, bore_layer="BORE")
    (note, *_) = drawing.read_contour(tmp_path / "inch.dxf").assumptions
    assert note.startswith("the part is 2.032 m long and 1.016 m in diameter")
    _holder(tmp_path / "mm.dxf", units=4, bore_layer="BORE")
    assert not any("check the unit" in text for text in drawing.read_contour(tmp_path / "mm.dxf").assumptions)


def test_a_layer_that_may_be_misspelt_is_told(tmp_path: Path) -> None:
    _holder(tmp_path / "mm.dxf", units=4, bore_layer="BORRE")
    contour = drawing.read_contour(tmp_path / "mm.dxf")
    assert not contour.contour.bores
    assert any('put "BORRE" into the layer BORE' in text for text in contour.assumptions), contour.assumptions
