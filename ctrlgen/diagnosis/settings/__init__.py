"""Every threshold, size and count of the diagnosis, with its unit, its meaning and the reason for its value; those of noise, fit and
residual tests are in `ctrlgen.estimation.settings`.

One frozen record a step; one file a package of `ctrlgen.diagnosis`. "Judgement" marks a value that no derivation fixes: it
was chosen on simulated recordings whose causes are known, and another value of the same order would serve too.
"""

from ctrlgen.diagnosis.settings.evidence import (
    BOOTSTRAP,
    EXCITATION,
    EXPERIMENT,
    LOCALISATION,
    LTV_MODEL,
    LUCK,
    MAPS,
    SPECTRAL_LINES,
    UNKNOWN_INPUT,
)
from ctrlgen.diagnosis.settings.regional_laws import REGIONS
from ctrlgen.diagnosis.settings.selection import (
    ATTRIBUTION,
    CONFUSABLE,
    DIRECT_DETECTION,
    MODEL_SELECTION,
    OBJECTIONS,
    PILES,
    PRECEDENCE,
    SCREEN,
    SEARCH,
    SPATIAL_PERIODS,
    SUBSETS,
)
from ctrlgen.diagnosis.settings.shares import SHARES
from ctrlgen.diagnosis.settings.verdict_settings import STANDING, VERDICT

__all__ = [
    "ATTRIBUTION",
    "BOOTSTRAP",
    "CONFUSABLE",
    "DIRECT_DETECTION",
    "EXCITATION",
    "EXPERIMENT",
    "LOCALISATION",
    "LTV_MODEL",
    "LUCK",
    "MAPS",
    "MODEL_SELECTION",
    "OBJECTIONS",
    "PILES",
    "PRECEDENCE",
    "REGIONS",
    "SCREEN",
    "SEARCH",
    "SHARES",
    "SPATIAL_PERIODS",
    "SPECTRAL_LINES",
    "STANDING",
    "SUBSETS",
    "UNKNOWN_INPUT",
    "VERDICT",
]
