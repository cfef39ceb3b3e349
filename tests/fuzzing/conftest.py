"""Tells at the end of the tests how many inputs of each kind were tried."""

import pytest

from hostile import CASES, TRIED


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    kinds = {kind for kind, _ in TRIED} & set(CASES)
    if not kinds:
        return
    terminalreporter.section("hostile input")
    terminalreporter.write_line(f"{'kind':24}{'tried':>8}{'worked':>8}{'refused':>9}")
    rows = [(kind, TRIED[kind, "worked"], TRIED[kind, "refused"]) for kind in CASES]
    rows = [row for row in rows if row[0] in kinds]
    rows.append(("all", sum(row[1] for row in rows), sum(row[2] for row in rows)))
    for kind, worked, refused in rows:
        terminalreporter.write_line(f"{kind:24}{worked + refused:8}{worked:8}{refused:9}")
