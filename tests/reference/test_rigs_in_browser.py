"""Records of a rig in a real Chromium: from dropped tables to a verified model and its report."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path

import numpy as np
import pytest

import flightid as fid
from tests.reference.test_app_in_browser import Desk, _findings, desk, zoomed_by_keys

__all__ = ["desk"]


def rig_tables(folder: Path, seed: int = 0) -> list[Path]:
    """Two manoeuvres of a sampled second-order rig with an outlier, in volts and radians.

    Tests with one workspace take another seed each: a set of records is known by its first file.
    """
    made = []
    for place, (name, n) in enumerate((("prbs", 700), ("steps", 260))):
        draw = np.random.default_rng(place + 10 * seed)
        drive = np.repeat(np.sign(draw.standard_normal(n // 5 + 1)), 5)[:n] * (1.0 - 0.4 * place)
        angle = np.zeros(n)
        for k in range(2, n):
            angle[k] = 1.6 * angle[k - 1] - 0.8 * angle[k - 2] + 0.05 * drive[k - 1]
        angle += 0.002 * draw.standard_normal(n)
        angle[n // 2] += 3.0 * (place == 1)
        rows = zip(np.arange(n) * 0.1, drive, angle, strict=True)
        lines = [
            "time [s],drive [V],swing [rad]",
            *(f"{t:.3f},{u:.6g},{y:.6g}" for t, u, y in rows),
        ]
        path = folder / f"{name}.csv"
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")
        made.append(path)
    return made


def test_from_dropped_tables_to_a_report(desk: Desk, tmp_path: Path) -> None:
    """Roles by hand, the study, one key, a run that equals `run_study`, the page and the zip."""
    expect = pytest.importorskip("playwright.sync_api").expect
    window = desk.open()
    page = window.page
    page.wait_for_selector(".empty")
    page.set_input_files("input[type=file]", rig_tables(tmp_path))
    page.locator("select[aria-label='Role of drive']").wait_for()
    page.select_option("select[aria-label='Role of drive']", "input")
    page.select_option("select[aria-label='Role of swing']", "output")
    page.locator(".uplot canvas").nth(1).wait_for()
    page.select_option("#place", label="steps.csv")
    page.locator(".fault", has_text="swing").first.wait_for()
    for name in ("drive", "swing"):
        chart = page.locator(f"[role=application][aria-label^='{name} of steps over time']")
        zoomed_by_keys(chart, page.get_by_role("button", name="Whole", exact=True))
    # A button stands where the command has a table to be written.
    fault = page.locator(".fault", has_text="swing").first.inner_text()
    assert "bridge it before any fit" in fault
    assert "conditioning" not in fault
    # What is bridged before structures are tried is so in the study, for all of its records.
    page.get_by_role("button", name="Bridge it").click()
    page.get_by_text("will be bridged").wait_for()
    unit = page.get_by_label("Unit of drive")
    unit.fill("mV")
    unit.press("Tab")
    page.click("text=Write the study")
    page.locator("#content .box").wait_for()
    rig = page.url.rpartition("/")[2]
    study = desk.folder / "studies" / f"{rig}.toml"
    assert desk.study["model"][0]["inputs"] == ["drive"]
    assert [each["records"] for each in desk.study["conditioning"]] == [["steps"]]
    # A unit is read back from where the study says it, and stays in a proposal made anew.
    page.reload()
    expect(unit).to_have_value("mV")
    page.click("text=Propose anew")
    page.locator("pre .changed").first.wait_for(state="detached")
    page.get_by_role("button", name="Propose anew").wait_for()
    expect(unit).to_have_value("mV")
    assert {each["units"]["drive"] for each in desk.study["record"]} == {"mV"}
    assert [each["records"] for each in desk.study["conditioning"]] == [["steps"]]
    unit.fill("V")
    unit.press("Tab")
    page.locator("pre .changed", has_text='drive = "V"').wait_for()
    assert not any("units" in each for each in desk.study["record"])
    page.select_option("#place", label="steps.csv")
    page.get_by_role("button", name="Do not bridge").click()
    page.locator("pre .changed", has_text="Tried before outliers").wait_for()
    assert not desk.study.get("conditioning")
    # What is advised about the spike is a click, and Undo takes it back.
    page.get_by_role("button", name="Bridge it").click()
    page.get_by_text("bridged by the study").wait_for()
    (bridging,) = desk.study["conditioning"]
    assert bridging["records"] == ["steps"]
    assert bridging["outliers"]["channels"] == ["swing"]
    page.get_by_role("button", name="Undo").click()
    page.get_by_role("button", name="Leave it out").click()
    page.locator("pre .changed", has_text="span_s").wait_for()
    (cut,) = (each["span_s"] for each in desk.study["record"] if each["name"] == "steps")
    assert cut == [0.0, 12.9]
    # What was done before a reload is taken back after it, and done again, by keys.
    page.reload()
    page.get_by_role("button", name="Undo").wait_for()
    page.keyboard.press("Control+z")
    page.get_by_role("button", name="Redo").wait_for()
    assert "span_s" not in desk.study["record"][-1]
    page.keyboard.press("Control+Shift+Z")
    page.locator("pre .changed", has_text="span_s").wait_for()
    page.keyboard.press("Control+z")
    page.get_by_role("button", name="Redo").wait_for()
    page.select_option("#place", label="steps.csv")
    page.get_by_role("button", name="Bridge it").click()
    page.select_option(".box select >> nth=0", "arx")
    page.locator("pre .changed", has_text='structure = "arx"').wait_for()
    page.fill("label:has-text('na') input", "2")
    page.press("label:has-text('na') input", "Tab")
    page.locator("pre .changed", has_text="na = 2").wait_for()
    page.click("text=Fit and verify")
    page.wait_for_selector("text=Fit again")
    page.locator(".box .js-plotly-plot").first.wait_for()
    said = _findings(page)
    # The run of the page is that of the verb, to the last digit.
    again = fid.run_study(study, output=tmp_path / "again").output / "results.json"
    (shown,) = (desk.folder / ".flightid" / "results" / rig).glob("run-*/results.json")
    assert json.loads(shown.read_text("utf-8")) == json.loads(again.read_text("utf-8"))
    page.click("nav >> text=Verify")
    page.click("[aria-label=Part] >> text=Residual tests")
    page.locator(".js-plotly-plot").first.wait_for()
    said += _findings(page)
    page.click("nav >> text=Report")
    said += _findings(page)
    with page.expect_download() as taken:
        page.click("text=Everything as one zip")
    with zipfile.ZipFile(taken.value.path()) as archive:
        archive.extractall(tmp_path / "zip")
    repeated = fid.run_study(tmp_path / "zip" / "studies" / study.name, output=tmp_path / "third")
    assert (
        repeated.identified[0].fit.cost
        == fid.run_study(study, output=tmp_path / "again").identified[0].fit.cost
    )
    with page.expect_popup() as opened:
        page.click("text=Open the report")
    report = opened.value
    report.wait_for_selector(".js-plotly-plot")
    assert report.evaluate("origin") == "null"  # it cannot reach the page
    report.close()
    assert not said
    assert not window.complaints
    page.close()


@pytest.mark.nightly
def test_gains_of_a_rig_by_hand(desk: Desk, tmp_path: Path) -> None:
    """Limits that the records propose, a slider, its numbers in the study, and back again."""
    window = desk.open()
    page = window.page
    page.set_default_timeout(120_000)
    page.set_input_files("input[type=file]", rig_tables(tmp_path, seed=1)[:1])
    page.select_option("select[aria-label='Role of drive']", "input")
    page.select_option("select[aria-label='Role of swing']", "output")
    page.get_by_text("Write the study").click()
    page.get_by_role("group", name="Trying structures").wait_for()
    page.locator("#content .box").wait_for()
    page.click("nav >> text=Gains")
    page.get_by_role("button", name="Take these as limits").click()
    page.locator("pre .changed", has_text="output_low = -1").wait_for()
    slider = page.locator("#slider-Kp")
    slider.wait_for()
    assert page.locator("label[for=slider-Kp]").inner_text() == "Kp V/rad"
    assert page.locator("[role=application][aria-label^='What the controller puts out']").count()
    assert "meets no limit" in page.locator(".reach").inner_text()
    # What is typed outside the range stands there with the range, and the gain stays.
    typed, kept = page.get_by_label("Ki, value"), page.get_by_label("Ki, value").input_value()
    typed.fill("1e9")
    typed.press("Tab")
    assert f"; {float(kept):g} " in page.locator("#why-value-Ki").inner_text()
    assert typed.input_value() == "1e9"
    assert "by_hand" not in desk.study["tune"]
    typed.fill(kept)
    typed.press("Tab")
    page.locator("#why-value-Ki").wait_for(state="detached")
    slider.press("End")
    page.get_by_text("Nothing to download: the reason stands above.").wait_for()
    # What to do is a button of the page, no key of a study.
    assert "press As found" in page.inner_text("main")
    assert "leave out by_hand" not in page.inner_text("main")
    # A loop that is unstable has no margins, and no share of any.
    page.locator("#slider-Ki").press("End")
    page.locator("#slider-Kd").press("Home")
    page.get_by_text("The loop is unstable with these gains: it has no margins.").wait_for()
    gains = page.inner_text("section[aria-label^='Gains of']")
    assert "unstable for 301 of 301 plants" in gains
    assert "%" not in gains
    page.get_by_text("The estimate is unstable with these gains.").wait_for()
    by_hand = desk.study["tune"]["by_hand"]
    assert by_hand.keys() == {"Kp", "Ki", "Kd"}
    page.get_by_role("button", name="As found").click()
    page.get_by_role("button", name="gains.toml").wait_for()
    assert "by_hand" not in desk.study["tune"]
    assert _findings(page) == []
    assert not window.complaints
    page.close()
