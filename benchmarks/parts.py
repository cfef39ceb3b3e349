"""The benchmark's parts: who is measured on which work."""

import contextlib
import dataclasses
import tempfile
from collections.abc import Callable, Iterator

from benchmarks.measure import Entry, Row, Worker, alternate, at_best_threads, job_seconds
from benchmarks.plan import Benchmark, devices, threads_to_try
from benchmarks.work import Work
from hyuav._support.machine import cores
from hyuav.physics import layout as layouts
from hyuav.physics.scenario import Scenario

Report = Callable[[str], None]
"""Told what is being measured."""

ENVIRONMENTS = ("make_env", "compiled_env", "random_numbers")
"""Measured at every batch size, compiled slots at large ones only; NumPy flies one helper."""

WORTH_COMPILING = 1024
"""Helpers."""

REFERENCE = "stable_baselines3"
"""The peer that is measured on the whole job and along with growing numbers of UEs and slots."""


def training(plan: Benchmark, scenario: Scenario, report: Report) -> Iterator[Row]:
    """Steady training steps/s of this project, by number of learners, and of its peers.

    The robust variant does more than the others' work in each step.
    """
    entries = [
        *(Entry("hyuav", _work(plan, scenario, learners=n)) for n in plan.learners),
        Entry("hyuav_robust", _work(plan, scenario, learners=max(plan.learners))),
        *(Entry(peer, _work(plan, scenario)) for peer in plan.peers),
        *_on_the_gpu(plan, scenario, plan.learners),
    ]
    yield from _side_by_side("training", entries, plan, report)


def scaling(plan: Benchmark, scenario: Scenario, report: Report) -> Iterator[Row]:
    """How training grows with the learners, the UEs and the horizon.

    To save trials, a learner gets a thread of its own as long as there are cores.
    """
    for learners in plan.scaling_learners:
        entry = Entry("hyuav", _work(plan, scenario, learners=learners))
        yield from _side_by_side("learners", [entry], plan, report, trials=False)
    for entry in _on_the_gpu(plan, scenario, plan.cuda_learners):
        yield from _side_by_side("learners", [entry], plan, report, trials=False)
    for num_ues in plan.ues:
        positions = layouts.disk(num_ues, seed=plan.seed)
        larger = dataclasses.replace(scenario, ue_positions=positions)
        yield from _side_by_side("ues", _few(plan, larger), plan, report, trials=False)
    for num_slots in plan.horizons:
        longer = dataclasses.replace(scenario, num_slots=num_slots)
        yield from _side_by_side("horizon", _few(plan, longer), plan, report, trials=False)


def job(plan: Benchmark, scenario: Scenario, report: Report) -> Iterator[Row]:
    """Whole trainings, each in a process of its own, start to finish.

    This project's are the first of their kind on a machine, and one of a learner that finds its
    program compiled.
    """

    def trained(name: str, learners: int = 1) -> Entry:
        threads = min(learners, cores())
        work = _work(plan, scenario, learners=learners, episodes=plan.episodes, threads=threads)
        return Entry(name, work)

    entries = [
        *(trained("hyuav", learners) for learners in plan.learners),
        *(trained(peer) for peer in plan.peers if peer == REFERENCE),
        trained("hyuav_again"),
    ]
    with tempfile.TemporaryDirectory() as cache:
        for number in range(1, plan.rounds + 1):
            for entry in entries:
                name, work = entry.name, entry.work
                report(f"job: {name}, {work.learners} x {plan.episodes} episodes, round {number}")
                kept = cache if name == "hyuav_again" or number == 1 else None
                yield job_seconds("job", entry, number, kept)


def references(plan: Benchmark, scenario: Scenario, report: Report) -> Iterator[Row]:
    """Evaluating five schemes for as many episodes as the job has, and solving for the optima."""
    work = _work(plan, scenario, episodes=plan.episodes)
    for name in ("five_schemes", "optima"):
        with Worker(Entry(name, work)) as worker:
            worker.start()
            for number in range(1, plan.rounds + 1):
                report(f"references: {name}, round {number}")
                yield worker.measure("references", 1e-3, number)  # once


def environment(plan: Benchmark, scenario: Scenario, report: Report) -> Iterator[Row]:
    """Slots/s of the environments by batch size, of the NumPy one, and of the draws alone.

    Peak memory is that of a process that has flown all batch sizes.
    """
    threads, seconds = threads_to_try(), plan.seconds / 10
    combinations = {helpers: _combinations(threads, helpers) for helpers in plan.batches}
    measured = {name for own in combinations.values() for name, *_ in own}
    rows: list[Row] = []
    with contextlib.ExitStack() as stack:
        workers = {
            name: stack.enter_context(
                Worker(Entry(name, _work(plan, scenario, threads=threads[-1])))
            )
            for name in (*sorted(measured), "numpy")
        }
        workers["numpy"].start(Entry("numpy", _work(plan, scenario)))
        for number in range(1, plan.rounds + 1):
            report(f"environment: round {number}")
            rows.append(workers["numpy"].measure("environment", seconds, number))
            for helpers, own in combinations.items():
                for name, device, count in own:
                    work = _work(plan, scenario, helpers=helpers, threads=count, device=device)
                    workers[name].start(Entry(name, work))
                    rows.append(workers[name].measure("environment", seconds, number))
        peaks = {name: worker.stop()["peak_mebibytes"] for name, worker in workers.items()}
    yield from ({**row, "peak_mebibytes": peaks[row["entry"]]} for row in rows)


def _combinations(threads: list[int], helpers: int) -> list[tuple[str, str, int]]:
    """Environment, device, threads."""
    return [
        (name, device, count)
        for name in ENVIRONMENTS
        if name != "compiled_env" or helpers >= WORTH_COMPILING
        for device in devices()
        for count in (threads if device == "cpu" else [1])
    ]


def _work(
    plan: Benchmark,
    scenario: Scenario,
    *,
    learners: int = 1,
    helpers: int = 1,
    episodes: int | None = None,
    threads: int = 1,
    device: str = "cpu",
) -> Work:
    work = Work(
        scenario,
        learners=learners,
        helpers=helpers,
        threads=threads,
        device=device,
        compile=plan.compile,
        seed=plan.seed,
    )
    return work if episodes is None else dataclasses.replace(work, episodes=episodes)


def _few(plan: Benchmark, scenario: Scenario) -> list[Entry]:
    """This project and one peer, where much is varied."""
    peers = [Entry(peer, _work(plan, scenario)) for peer in plan.peers if peer == REFERENCE]
    return [*(Entry("hyuav", _work(plan, scenario, learners=n)) for n in plan.learners), *peers]


def _on_the_gpu(plan: Benchmark, scenario: Scenario, numbers: tuple[int, ...]) -> list[Entry]:
    if "cuda" not in devices():
        return []
    return [Entry("hyuav", _work(plan, scenario, learners=n, device="cuda")) for n in numbers]


def _side_by_side(
    part: str, entries: list[Entry], plan: Benchmark, report: Report, *, trials: bool = True
) -> list[Row]:
    """Measure entries in turn, each at its best number of threads, by trials or by rule."""
    trial = min(plan.seconds, 3.0)
    with contextlib.ExitStack() as stack:
        workers = []
        for entry in entries:
            work = entry.work
            report(
                f"{part}: {entry.name}, {work.learners} learners, U = {work.scenario.num_ues}, "
                f"T = {work.scenario.num_slots}, {work.device}"
            )
            if work.device != "cpu":
                threads = [1]
            else:
                threads = threads_to_try() if trials else [min(work.learners, cores())]
            workers.append(stack.enter_context(at_best_threads(entry, threads, trial)))
        report(f"{part}: {plan.rounds} rounds of {plan.seconds:g} s")
        return alternate(part, workers, plan.rounds, plan.seconds)


MEASURE = {
    "training": training,
    "environment": environment,
    "job": job,
    "references": references,
    "scaling": scaling,
}
"""By the name of the part."""
