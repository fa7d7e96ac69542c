"""Writes the JSON Schemas of the result files: `python -m ctrlgen.app.write_schemas`, `make schemas`."""

from __future__ import annotations

from pathlib import Path

from pydantic import BaseModel

from ctrlgen.budget.budget_schema import BudgetRecord
from ctrlgen.calibration.calibration_schema import CalibrationRecord
from ctrlgen.core.files import write_text
from ctrlgen.diagnosis.report.diagnosis_record import DiagnosisRecord
from ctrlgen.learning.learning_schema import LearningRecord
from ctrlgen.path_timing.fastest_schema import FastestRecord
from ctrlgen.reporting.result_file import SCHEMAS, schema_text
from ctrlgen.verification.summary_schema import BuildRecord, Summary

RESULTS: dict[str, type[BaseModel]] = {
    "budget": BudgetRecord,
    "build": BuildRecord,
    "constants": CalibrationRecord,
    "diagnosis": DiagnosisRecord,
    "fastest": FastestRecord,
    "learning": LearningRecord,
    "summary": Summary,
}


def schemas() -> dict[str, str]:
    """The text of every schema by its file name."""
    return {f"{name}.schema.json": schema_text(model, f"{name}.json") for name, model in RESULTS.items()}


def write_schemas(folder: Path = SCHEMAS) -> None:
    """Every schema into `folder`."""
    for name, text in schemas().items():
        write_text(folder / name, text)


if __name__ == "__main__":
    write_schemas()
