"""One screen for a long run: counts, time left, failures with the last lines of their logs; no line is wide."""

from pathlib import Path

import pytest

from mtcsirl.study import screen
from mtcsirl.study.screen import EXPECTED, WIDEST, Screen, duration, last_lines, short, wrapped


class Clock:
    """Seconds that a test lets pass."""

    now = 0.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def shown(clock: Clock) -> Screen:
    made = Screen(clock=clock)
    made.planned({"train_sac": 4, "figure_1": 1})
    return made


def test_what_will_be_done_is_said_in_a_line() -> None:
    assert Screen().planned({"train_sac": 4, "figure_1": 1}) == ["5 jobs: 4 train_sac, figure_1"]


def test_a_finished_job_is_one_line_with_the_time_left(shown: Screen, clock: Clock) -> None:
    shown.started(1, "train_sac", "results/sac/reach-t0/s0", None)
    clock.now = 10.0
    line = shown.finished(1)
    assert line == "1 of 5 train_sac results/sac/reach-t0/s0, 10 s, about 35 s left"
    assert shown.finished(7) == "", "a job of which nothing was said"


def test_the_plan_counts_until_a_rule_was_measured(
    shown: Screen, clock: Clock, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(EXPECTED, "train_sac", 100.0)
    assert shown.seconds_left() == pytest.approx(4 * 100 + screen.UNKNOWN)
    shown.started(1, "train_sac", "", None)
    clock.now = 30.0
    assert shown.seconds_left() == pytest.approx(4 * 100 + screen.UNKNOWN - 30), "what runs is on its way"
    shown.finished(1)
    assert shown.seconds_left() == pytest.approx(3 * 30 + screen.UNKNOWN)
    shown.started(2, "train_sac", "", None)
    shown.started(3, "train_sac", "", None)
    assert shown.seconds_left() == pytest.approx((3 * 30 + screen.UNKNOWN) / 2), "two at once"


def test_a_failure_shows_the_end_of_its_log_and_later_ones_a_line(shown: Screen, tmp_path: Path) -> None:
    log = tmp_path / "job.log"
    log.write_text("\n".join(f"line {number}" for number in range(100)) + f"\n{'x' * 10_000}\n")
    lines = shown.fails(1, "train_sac", "results/sac", [log])
    assert [line.split()[0] for line in lines[:-1]] == ["failed:", "line", "line", "line", "line"]
    assert str(log) in lines[0]
    assert max(map(len, lines)) <= WIDEST
    many = [shown.fails(number, "train_sac", "results/sac", [log]) for number in range(2, 20)]
    assert len(many[0]) == len(lines)
    assert len(many[-1]) == 1
    assert shown.fails(30, "all", "", [tmp_path / "none.log"])[0].startswith("failed: all")


def test_the_block_of_a_terminal(shown: Screen, clock: Clock, tmp_path: Path) -> None:
    log = tmp_path / "job.log"
    log.write_text("step 100/400\rstep 200/400\n")
    shown.started(1, "train_sac", "results/sac/reach-t0/s0", log)
    shown.started(2, "train_sac", "results/sac/reach-t0/s1", None)
    shown.fails(2, "train_sac", "results/sac/reach-t0/s1", [])
    clock.now = 4.0
    block = shown.block(80)
    assert block[0].startswith("0 of 5 done, 1 failed, about ")
    assert block[1] == "train_sac 0/4"
    assert block[2].split() == ["4", "s", "train_sac", "results/sac/reach-t0/s0:", "step", "200/400"]
    assert max(map(len, shown.block(40))) < 40
    shown.started(2, "train_sac", "", None)
    assert "failed" not in shown.block(80)[0], "it is tried again"


def test_lines_are_cut_and_wrapped_and_short_ones_left_alone() -> None:
    assert short("x" * 200) == "x" * 200
    cut = short("a" * 300 + "end")
    assert len(cut) == WIDEST
    assert cut.endswith("aend")
    assert wrapped("one\n  two") == ["one", "  two"]
    long = wrapped("word " * 100)
    assert max(map(len, long)) <= WIDEST
    assert " ".join(long).split() == ["word"] * 100, "nothing is left out"


def test_durations_and_logs(tmp_path: Path) -> None:
    assert [duration(seconds) for seconds in (7.6, 240, 9000)] == ["8 s", "4 min", "2.5 h"]
    assert last_lines(tmp_path / "none", 3) == []
    (tmp_path / "log").write_bytes(b"\xff\n" * 5000 + b"last\n\n")
    assert last_lines(tmp_path / "log", 1) == ["last"]
