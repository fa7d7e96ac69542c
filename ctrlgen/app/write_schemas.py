"""Writes the JSON Schemas of the result files: `python -m ctrlgen.app.write_schemas`, `make schemas`."""

from __future__ import annotations

from pathlib import Path

from pydantic import BaseModel

from ctrlgen.budget.budget_record import BudgetRecord
from ctrlgen.calibration.calibration_record import CalibrationRecord
from ctrlgen.calibration.jacobian_record import JacobianRecord
from ctrlgen.core.files import write_text
from ctrlgen.diagnosis.report.diagnosis_record import DiagnosisRecord
from ctrlgen.learning.learning_record import LearningRecord
from ctrlgen.path_timing.fastest_record import FastestRecord
from ctrlgen.reporting.result_file import SCHEMAS, schema_text
from ctrlgen.verification.build_record import BuildRecord
from ctrlgen.verification.summary import Summary

RESULTS: dict[str, type[BaseModel]] = {
    "budget": BudgetRecord,
    "build": BuildRecord,
    "constants": CalibrationRecord,
    "diagnosis": DiagnosisRecord,
    "fastest": FastestRecord,
    "jacobian": JacobianRecord,
    "learning": LearningRecord,
    "summary": Summary,
}


def schemas() -> dict[str, str]:
    """The text of every schema by its file name."""
    return {f"{name}.schema.json": schema_text(model, f"{name}.json") for name, model in RESULTS.items()}


def write_schemas(folder: Path = SCHEMAS) -> None:
    """Writes the JSON Schema of every file format into `folder`."""
    for name, text in schemas().items():
        write_text(folder / name, text)


if __name__ == "__main__":
    write_schemas()
