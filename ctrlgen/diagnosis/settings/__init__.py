"""Every threshold, size and count of the diagnosis, with its unit, its meaning and the reason for its value.

One frozen record a step; one file a package of `ctrlgen.diagnosis`. "Judgement" marks a value that no derivation fixes: it
was chosen on simulated recordings whose causes are known, and another value of the same order would serve too.
"""

from ctrlgen.diagnosis.settings.estimation import (
    DISCREPANCY,
    FIT,
    HELD_OUT_REFIT,
    NOISE,
    NOISE_UPDATE,
    OUTLIERS,
    PROFILE,
    RESIDUAL_NOISE,
    RESIDUAL_TESTS,
    ROBUST_COVARIANCE,
    SIMULATION,
    STATISTICS,
)
from ctrlgen.diagnosis.settings.evidence import (
    BOOTSTRAP,
    DETECTABILITY,
    EXCITATION,
    EXPERIMENT,
    LOCALISATION,
    LTV_MODEL,
    MAPS,
    SPECTRAL_LINES,
    UNKNOWN_INPUT,
)
from ctrlgen.diagnosis.settings.selection import (
    ATTRIBUTION,
    CANDIDATE_TERMS,
    DIRECT_DETECTION,
    MODEL_SELECTION,
    OBJECTIONS,
    SCREEN,
    SEARCH,
    SPATIAL_PERIODS,
    SUBSETS,
    VERDICT,
)
from ctrlgen.diagnosis.settings.shares import SHARES

__all__ = [
    "ATTRIBUTION",
    "BOOTSTRAP",
    "CANDIDATE_TERMS",
    "DETECTABILITY",
    "DIRECT_DETECTION",
    "DISCREPANCY",
    "EXCITATION",
    "EXPERIMENT",
    "FIT",
    "HELD_OUT_REFIT",
    "LOCALISATION",
    "LTV_MODEL",
    "MAPS",
    "MODEL_SELECTION",
    "NOISE",
    "NOISE_UPDATE",
    "OBJECTIONS",
    "OUTLIERS",
    "PROFILE",
    "RESIDUAL_NOISE",
    "RESIDUAL_TESTS",
    "ROBUST_COVARIANCE",
    "SCREEN",
    "SEARCH",
    "SHARES",
    "SIMULATION",
    "SPATIAL_PERIODS",
    "SPECTRAL_LINES",
    "STATISTICS",
    "SUBSETS",
    "UNKNOWN_INPUT",
    "VERDICT",
]
