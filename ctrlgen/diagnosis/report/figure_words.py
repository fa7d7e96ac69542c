"""Titles and captions of the figures of a diagnosis."""

FIGURES = {
    "readings": (
        "Measured against simulated",
        "Measured against simulated on the held-out records, drawn where the error is largest, and the error below (grey: noise, "
        "± 2 sd). Of more than three readings those with the largest error over their noise are drawn.",
    ),
    "residuals": (
        "Residual",
        "Residual on the held-out records. Gaps are samples that were marked as not usable.",
    ),
    "spectrum": (
        "Spectrum of the residual",
        "Amplitude spectral density of the same residual. Where a curve meets the noise, this recording holds no more "
        "information.",
    ),
    "shares_before": (
        "Shares before the correction",
        "What the device as described leaves: how much of its energy each kind of signal explains in blocks that were not used, "
        "with 95 % intervals. Blue: selected in this order, diamonds: what each adds. Dashed: all together, the ceiling of any "
        "law that is a function of them. Below: the residual over the best ones, and the smoother.",
    ),
    "shares_after": (
        "Shares after the correction",
        "The same of what the model with the findings leaves.",
    ),
    "where": (
        "Where the residual is",
        "Excess of the residual of the device as described over the noise, with 95 % intervals, by part of the recording.",
    ),
    "unknown": (
        "Unknown input",
        "Unknown input that would explain the residual after the correction, with 95 % intervals: its shape hints at the effect.",
    ),
    "intervals": (
        "Numbers with their intervals",
        "Where an interval includes zero, the cause may be absent.",
    ),
    "profiles": (
        "Profiles of the likelihood",
        "Profile likelihood: the objective with one parameter held and the others refitted. The 95 % interval (shaded) lies below "
        "the dotted line.",
    ),
    "rivals": (
        "Rounds of the search",
        "Each round fits the hypotheses with the largest scores and keeps the best. The criterion T adds the whitened squares on "
        "the records to fit, the held-out deviance and a penalty for every parameter. Blue: in the final model; orange: explains "
        "equally well; grey: worse.",
    ),
    "confusability": (
        "What can be confused",
        "How similar the effects of two hypotheses on the readings are: |cos| of their sensitivities, projected off the device's "
        "uncertain parameters. At 1 they cannot be told apart, at 0 they cannot be confused. Each has fixed shape parameters; "
        "fitting those can make two more similar. |z|: score in standard deviations.",
    ),
}
