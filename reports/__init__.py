"""Reports: a result model, its storage, and what is made of it (HTML, JUnit XML, summaries, coverage).

This package reads results and runs nothing; it knows none of the other packages. A run is either built in
memory as a `RunResult`, or written as it happens with `start_run`, `write_case` and `finish_run` and read
back with `load_run`. `write_report` makes all files of a run. Templates, plots and their libraries are loaded
when they are first needed.
"""

from reports.compare import Background, Comparison, Drift, Slower, compare_runs, remember
from reports.coverage import (
    Cell,
    Matrix,
    PrefixTotal,
    RequirementRow,
    fault_reaction_matrix,
    fault_state_matrix,
    prefix_totals,
    requirement_matrix,
)
from reports.errors import ReportError, StoreError
from reports.files import ReportPaths, render_html, write_report
from reports.history import HISTORY_FILE, History, HistoryError, PastCase, PastRun
from reports.junit import junit_tree, write_junit
from reports.markdown import markdown_summary
from reports.measures import Measure, measures
from reports.merge import merge_runs
from reports.model import (
    AlarmRecord,
    CaseResult,
    Check,
    FaultRecord,
    Message,
    Reaction,
    RequirementInfo,
    RunResult,
    Scalar,
    Signal,
    Step,
    Verdict,
)
from reports.seeding import Defect, Seeding, load_seeding
from reports.store import finish_run, load_run, save_run, start_run, stored_cases, write_case
from reports.summary import full_summary, run_digest, summary, write_summary
from reports.tables import write_cases
from reports.text import (
    check_sentence,
    headline,
    margin,
    margin_text,
    reaction_name,
    replay_command,
    run_state,
)

__all__ = [
    "HISTORY_FILE",
    "AlarmRecord",
    "Background",
    "CaseResult",
    "Cell",
    "Check",
    "Comparison",
    "Defect",
    "Drift",
    "FaultRecord",
    "History",
    "HistoryError",
    "Matrix",
    "Measure",
    "Message",
    "PastCase",
    "PastRun",
    "PrefixTotal",
    "Reaction",
    "ReportError",
    "ReportPaths",
    "RequirementInfo",
    "RequirementRow",
    "RunResult",
    "Scalar",
    "Seeding",
    "Signal",
    "Slower",
    "Step",
    "StoreError",
    "Verdict",
    "check_sentence",
    "compare_runs",
    "fault_reaction_matrix",
    "fault_state_matrix",
    "finish_run",
    "full_summary",
    "headline",
    "junit_tree",
    "load_run",
    "load_seeding",
    "margin",
    "margin_text",
    "markdown_summary",
    "measures",
    "merge_runs",
    "prefix_totals",
    "reaction_name",
    "remember",
    "render_html",
    "replay_command",
    "requirement_matrix",
    "run_digest",
    "run_state",
    "save_run",
    "start_run",
    "stored_cases",
    "summary",
    "write_case",
    "write_cases",
    "write_junit",
    "write_report",
    "write_summary",
]
