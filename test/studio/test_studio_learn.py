"""Learning from a page in a real browser: a name of one's own, played meanwhile; stop, go on, compare."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Locator, Page, expect

from browser import ask_unasked, browser_path, open_page
from msrd_ros.core.resources import shipped_bags
from msrd_ros.table_tennis.strokes.policies import StrokePolicies
from msrd_ros.table_tennis.strokes.training import StrokeTrainingConfig
from renamed_bags import rename_strokes
from stack import START_TIMEOUT_S, Stack
from studio_stack import start_page, start_studio, wait_for_page

pytestmark = [pytest.mark.processes, pytest.mark.timeout(500)]

OWN = "my-drive"
OTHER = "backhand-push"
SLOW_MS = 300_000
"""Bags are read, policies cloned and balls played beside simulator, executor and browser."""


@pytest.fixture(scope="module")
def bags(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("library")
    rename_strokes(shipped_bags(), "forehand-topspin", folder, OWN)
    return folder


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("runs")


@pytest.fixture(scope="module")
def page(shared_stack: Stack, bags: Path, runs: Path) -> Iterator[Page]:
    browser_path()
    with open_page(start_studio(shared_stack, bags=str(bags), runs=str(runs))) as one:
        expect(one.locator("#phase")).to_contain_text("waits", timeout=1000 * START_TIMEOUT_S)
        yield one


def tab(page: Page, name: str) -> None:
    page.get_by_role("tab", name=name).click()


def choose(page: Page, iterations: int, own: bool = True, shipped: str = "", name: str = "") -> None:
    """Fill in what is to be learned, and begin."""
    tab(page, "Learn")
    if page.locator("#lessons").get_attribute("open") is None:
        page.locator("#lessons summary").click()
    page.locator(f"#learn-own-{OWN}").set_checked(own)
    for box in page.locator("#shipped-labels input").all():
        box.set_checked(box.get_attribute("value") == shipped)
    page.locator("#iterations").fill(str(iterations))
    page.locator("#run-name").fill(name)
    page.locator("#start-training").click()


def wait_for_phase(page: Page, text: str) -> None:
    expect(page.locator("#learning-said")).to_contain_text(text, timeout=SLOW_MS)


def iteration(page: Page) -> int:
    return int(page.locator("#learning-bar").get_attribute("value") or 0)


def run(page: Page, name: str) -> Locator:
    return page.locator(f'#runs tbody tr[data-run="{name}"]')


def result(runs: Path, name: str) -> dict[str, object]:
    return dict(json.loads((runs / name / "training.json").read_text()))


def test_studio_learn_offers_what_is_recorded_and_what_comes_with_the_package(page: Page) -> None:
    tab(page, "Learn")
    expect(page.locator("#own-labels label")).to_have_text([f"{OWN} 9"])
    expect(page.locator("#shipped-labels label")).to_have_count(6)
    expect(page.locator("#no-runs")).to_be_visible()
    expect(page.locator("#iterations")).to_have_value(str(StrokeTrainingConfig.iterations))
    expect(page.locator("#policy-rule")).to_contain_text("after every fifth iteration")


def test_studio_learn_says_what_cannot_be_learned_from(page: Page, runs: Path) -> None:
    choose(page, 5, own=False)
    expect(page.locator("#said.bad")).to_contain_text("nothing to learn from: choose labels")
    page.evaluate("document.getElementById('train').noValidate = true")
    choose(page, 5, name="no name")
    expect(page.locator("#said.bad")).to_contain_text("'no name' is no name of a run")
    choose(page, 0)
    expect(page.locator("#said.bad")).to_contain_text("iterations is 0; give 1 to 10000")
    assert list(runs.iterdir()) == []


def test_studio_learn_plays_a_name_of_ones_own_while_it_is_learned(page: Page, runs: Path) -> None:
    choose(page, 1000, name="drive")
    wait_for_phase(page, "drive: iteration")
    expect(page.locator("#start-training")).to_be_disabled()
    expect(run(page, "drive").locator("td").nth(1)).to_have_text("running")
    tab(page, "Play")
    button = page.locator(f'#strategies button[data-name="{OWN}"]:not(.absent)')
    expect(button).to_be_visible()
    expect(page.locator(f'#strategies button[data-name="{OTHER}"].absent')).to_be_visible()
    button.click()
    expect(page.locator("#said")).to_contain_text(f"{OWN} from the next ball on")
    page.get_by_role("button", name="Feed a ball").click()
    row = page.locator("#rates tbody tr").filter(has_text=OWN)
    expect(row.locator("td").nth(1)).to_have_text("1", timeout=SLOW_MS)
    expect(page.locator("#training-mark")).to_be_visible()
    tab(page, "Learn")
    expect(page.locator("#learning-curves polyline")).to_have_count(1)
    expect(page.locator("#legend")).to_have_text(OWN)
    # Policies go out as soon as there are any, and into the file with the next checkpoint.
    checkpoint = runs / "drive" / "policies.safetensors"
    deadline = time.monotonic() + START_TIMEOUT_S
    while not checkpoint.exists() and time.monotonic() < deadline:
        page.wait_for_timeout(200)
    assert StrokePolicies.load(checkpoint).labels == (OWN,)


def test_studio_learn_stops_with_a_checkpoint_and_goes_on_from_it(page: Page, runs: Path) -> None:
    tab(page, "Learn")
    page.get_by_role("button", name="Stop", exact=True).click()
    wait_for_phase(page, "drive was stopped after iteration")
    done = int(str(result(runs, "drive")["iterations"]))
    assert f"iteration {done} of 1000" in page.locator("#learning-said").inner_text()
    expect(run(page, "drive").locator("td").nth(1)).to_have_text("stopped")
    expect(run(page, "drive").locator("td").nth(2)).to_have_text(f"{done} of 1000")
    page.get_by_role("button", name="Go on").click()
    expect(page.locator("#said")).to_contain_text(f"drive goes on after iteration {done}")
    wait_for_phase(page, "drive: iteration")
    assert iteration(page) > done
    assert f"goes on from iteration {done} of" in (runs / "drive" / "trainer.log").read_text()
    page.get_by_role("button", name="Stop", exact=True).click()
    wait_for_phase(page, "drive was stopped after iteration")
    assert int(str(result(runs, "drive")["iterations"])) > done


def test_studio_learn_mixes_bags_and_compares_two_runs(page: Page, runs: Path) -> None:
    choose(page, 2, shipped=OTHER, name="both")
    wait_for_phase(page, "both is done after iteration 2 of 2")
    assert result(runs, "both")["demonstrations"] == {OWN: 9, OTHER: 9}
    expect(run(page, "both").locator("td").nth(1)).to_have_text("done")
    # One run: a curve for each strategy, rates, and the matrix.
    expect(page.locator("#learning-curves polyline")).to_have_count(2)
    expect(page.locator("#run-rates tbody tr")).to_have_count(2)
    expect(page.locator("#matrix tbody tr")).to_have_count(2)
    expect(page.locator("#matrix-said")).to_contain_text("of 2")
    run(page, "drive").click(modifiers=["Control"])
    expect(page.locator("#results-title")).to_have_text("both and drive")
    lines = page.locator("#learning-curves polyline")
    expect(lines).to_have_count(2)
    assert len({line.get_attribute("stroke") for line in lines.all()}) == 2
    expect(page.locator("#legend span")).to_have_text(["both", "drive"])
    seconds = page.locator("#run-rates tbody tr").filter(has_text="iterations").locator("td")
    done = result(runs, "drive")["iterations"]
    expect(seconds).to_have_text(["iterations", "2 of 2", f"{done} of 1000"])
    page.locator("#figure").select_option(label="discriminator: loss")
    expect(lines).to_have_count(2)


def test_studio_learn_gives_a_run_to_the_executor(page: Page, shared_stack: Stack, runs: Path) -> None:
    run(page, "drive").click()
    page.get_by_role("button", name="Play this run").click()
    expect(page.locator("#said")).to_contain_text(f"drive is played from the next stroke on: {OWN}")
    digest = StrokePolicies.load(runs / "drive" / "policies.safetensors").digest
    shared_stack.wait_until(
        lambda: shared_stack.diagnosed("executor")["policies"] == digest, "policies", START_TIMEOUT_S
    )


def test_studio_learn_does_not_double_a_trainer_from_elsewhere(
    page: Page, shared_stack: Stack, tmp_path: Path
) -> None:
    trainer = shared_stack.start("trainer", source="played", out=str(tmp_path))
    trainer.wait_for_line("waiting for 9 demonstrations")
    wait_for_phase(page, "Somebody else's trainer is at work")
    expect(page.locator("#start-training")).to_be_disabled()
    answer = ask_unasked(page, do="train")
    assert answer["ok"] is False
    assert "somebody else's trainer is in the graph" in str(answer["text"])
    assert trainer.stop() == 0
    expect(page.locator("#start-training")).to_be_enabled()


def test_studio_learn_ends_in_order_with_the_studio(
    page: Page, stack: Stack, bags: Path, tmp_path: Path
) -> None:
    studio = start_page(stack, bags=str(bags), runs=str(tmp_path))
    browser = page.context.browser
    assert browser is not None
    other = browser.new_page()
    other.goto(wait_for_page(stack, studio))
    choose(other, 1000, name="cut")
    wait_for_phase(other, "cut: iteration")
    seen = iteration(other)
    assert studio.stop() == 0, studio.output
    other.close()
    assert int(str(result(tmp_path, "cut")["iterations"])) >= seen
    assert (tmp_path / "cut" / "checkpoint.safetensors").is_file()
    stack.wait_until(lambda: not stack.node.count_publishers("training/progress"), "end of the trainer")
