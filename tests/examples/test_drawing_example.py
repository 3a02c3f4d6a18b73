"""The example drawing: an end mill in a drawn holder, measured by thin cylinders that share no code with it."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import ezdxf
import numpy as np
import pytest

import drawn_holder
import foreign_holder
from command_line import call
from receptance import SectionShape, campaign, examples
from receptance.campaign import Campaign

LEAST_CYLINDERS = 2000
TRUE_MATERIALS = {"carbide-10co": foreign_holder.CARBIDE, "holder-steel": foreign_holder.STEEL}


def entities(document: ezdxf.document.Drawing) -> list[tuple[str, str, list[float]]]:
    """Return type, layer and coordinates of each entity."""
    rows = []
    for entity in document.modelspace():
        numbers = (
            [*entity.dxf.start, *entity.dxf.end] if entity.dxftype() == "LINE" else np.ravel(entity.get_points("xyb"))
        )
        rows.append((entity.dxftype(), entity.dxf.layer, [float(number) for number in numbers]))
    return rows


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    target = tmp_path_factory.mktemp("drawing")
    examples.write("drawing", target)
    return target


@pytest.fixture(scope="module")
def true_campaign(tmp_path_factory: pytest.TempPathFactory) -> Campaign:
    """The campaign with the materials of the generator, and a contour that is ten times as close to the arcs."""
    target = tmp_path_factory.mktemp("true")
    examples.write("drawing", target)
    tables = "".join(
        f'[materials.{name}]\nyoungs_modulus = "{material.modulus} Pa"\ndensity = "{material.density} kg/m^3"\n'
        f"poisson_ratio = {material.poisson}\nloss_factor = {material.loss}\n"
        for name, material in TRUE_MATERIALS.items()
    )
    text = (target / "campaign.toml").read_text(encoding="utf-8")
    contour = 'contour = "holder.dxf"\n'
    text = text.replace(contour, f'{contour}within = "0.002 mm"\n').replace("[parts.holder]", f"{tables}[parts.holder]")
    (target / "campaign.toml").write_text(text, encoding="utf-8")
    return campaign.load(target)


def results(folder: Path, command: str, file: Path) -> dict[str, Any]:
    """Return the JSON of a command on the example."""
    assert call(command, folder, "--json", file) == 0
    return dict(json.loads(file.read_text(encoding="utf-8")))


def test_the_generator_shares_nothing_with_the_package() -> None:
    code = "import sys; import foreign_holder; print([m for m in sys.modules if m.split('.')[0] == 'receptance'])"
    place = Path(foreign_holder.__file__).parent
    done = subprocess.run([sys.executable, "-c", code], cwd=place, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_the_holder_is_of_thin_cylinders() -> None:
    assert foreign_holder.holder().mass.size >= LEAST_CYLINDERS


def test_the_packaged_drawing_is_that_of_the_script(folder: Path) -> None:
    packaged = ezdxf.readfile(folder / "holder.dxf")
    assert packaged.header["$INSUNITS"] == drawn_holder.holder().header["$INSUNITS"]
    rows, expected = entities(packaged), entities(drawn_holder.holder())
    assert [row[:2] for row in rows] == [row[:2] for row in expected]
    for row, other in zip(rows, expected, strict=True):
        assert row[2] == pytest.approx(other[2], abs=1e-9)


@pytest.mark.slow
def test_the_packaged_records_are_those_of_the_foreign_model(folder: Path, tmp_path: Path) -> None:
    for path in foreign_holder.write(tmp_path)[1:]:
        packaged, written = (np.loadtxt(file, delimiter=",", skiprows=1) for file in (folder / path.name, path))
        np.testing.assert_allclose(packaged, written, rtol=2e-5, atol=2e-6)


def test_area_and_second_moment_of_the_flutes_are_those_of_the_foreign_polygon() -> None:
    area, second = foreign_holder.integrals(foreign_holder.fluted_polygon())
    diameter = 1e-3 * foreign_holder.DIAMETER_MM
    shape = SectionShape.fluted(foreign_holder.FLUTES, diameter=diameter, core_diameter=1e-3 * foreign_holder.CORE_MM)
    assert shape.area * np.pi / 4.0 * diameter**2 == pytest.approx(area, rel=1e-5)
    assert shape.moment == pytest.approx([second / (np.pi / 64.0 * diameter**4)] * 2, rel=1e-5)


@pytest.mark.parametrize("overhang_mm", foreign_holder.OVERHANGS_MM)
def test_the_model_with_the_true_values_is_the_foreign_one(true_campaign: Campaign, overhang_mm: float) -> None:
    """Apart from the shear coefficient of the flutes, which the generator has from the energy."""
    name = f"{overhang_mm:g} mm"
    lines = foreign_holder.LINES_HZ[::40]
    measured = true_campaign.measurements[name]
    assembly = measured.assembly.replace(foreign_holder.JOINT)
    tip = assembly.receptance(lines, response=measured.response, excitation=measured.excitation)
    accelerance = -((2.0 * np.pi * lines) ** 2) * np.ravel(tip)
    foreign = foreign_holder.accelerance(overhang_mm, lines) * foreign_holder.GRAVITY
    np.testing.assert_allclose(accelerance, foreign, rtol=2e-3, atol=2e-3 * np.abs(foreign).min())


def test_contour_and_check_read_the_drawing(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert call("contour", folder / "holder.dxf", "--material", "holder-steel", "--no-window") == 0
    assert "bores: 2" in capsys.readouterr().out
    assert call("check", folder, "--no-window") == 0
    text = " ".join(capsys.readouterr().out.split())
    for command in ("identify", "predict", "transfer", "diagnose", "invert", "next"):
        assert f"receptance {command} ready" in text
    assert 'the profile is that of layer "NOCUT"' in text


@pytest.mark.slow
def test_the_true_joint_is_identified(folder: Path, tmp_path: Path) -> None:
    fit = results(folder, "identify", tmp_path / "identified.json")
    assert fit["adequacy"]["passed"]
    for address, value in foreign_holder.JOINT.items():
        least, most = fit["parameters"][address]["interval_95"]
        print(f"{address}: {fit['parameters'][address]['value']:.5g}, {least:.5g} to {most:.5g}, true {value:.5g}")
        assert least < value < most, address


@pytest.mark.slow
def test_the_record_that_is_held_out_is_predicted(folder: Path, tmp_path: Path) -> None:
    """The misfit of its lines, natural frequencies within 0.2 %, and those of every overhang from the two others."""
    (held_out,) = results(folder, "predict", tmp_path / "predicted.json")["frfs"]
    print(
        f"held out: {held_out['rms_decibel']:.2f} dB, {100 * held_out['share_within']:.1f} % of the lines in the band"
    )
    assert held_out["name"] == f"{max(foreign_holder.OVERHANGS_MM):g} mm"
    assert held_out["rms_decibel"] < 1.0
    assert held_out["share_within"] > 0.95
    transfer = results(folder, "transfer", tmp_path / "transfer.json")
    print(f"each overhang from the others: {transfer['modes']} modes, {transfer['rms_percent']:.3f} % rms")
    assert len(transfer["splits"]) == len(foreign_holder.OVERHANGS_MM)
    assert transfer["inside"] == transfer["modes"] > 0
    assert transfer["rms_percent"] < 0.2


@pytest.mark.slow
def test_the_model_is_adequate_and_has_a_next_measurement(folder: Path, tmp_path: Path) -> None:
    diagnosis = results(folder, "diagnose", tmp_path / "diagnosis.json")
    assert (diagnosis["verdict"], diagnosis["final"], diagnosis["causes"]) == ("adequate", True, [])
    assert results(folder, "next", tmp_path / "next.json")["ranking"]


@pytest.mark.slow
def test_a_cylinder_in_place_of_the_flutes_is_not_adequate(tmp_path: Path) -> None:
    """The 80 % of the diameter of Kops and Vo: the fit is not adequate, and the fluted part is suspected."""
    crude = tmp_path / "crude"
    examples.write("drawing", crude)
    text = (crude / "campaign.toml").read_text(encoding="utf-8")
    flutes = 'outer_diameter = "12 mm"\nshape = { flutes = 4, core_diameter = "7.2 mm" }'
    assert text.count(flutes) == 1
    (crude / "campaign.toml").write_text(text.replace(flutes, 'outer_diameter = "9.6 mm"'), encoding="utf-8")
    fit = results(crude, "identify", tmp_path / "identified.json")
    assert not fit["adequacy"]["passed"]
    print(f"misfit {fit['adequacy']['misfit']:.2f}, k_theta {fit['parameters']['joint.k_theta']['interval_95']}")
    diagnosis = results(crude, "diagnose", tmp_path / "diagnosis.json")
    assert diagnosis["verdict"] in ("named", "suspected")
    assert [cause["id"] for cause in diagnosis["causes"]] == ["fluted_part"]
