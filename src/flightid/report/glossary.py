"""Plain words for what headings say, shown on hover."""

from __future__ import annotations

GLOSSARY = {
    "average cost": "How far a model lies from the measured responses: below 50 nearly the same, "
    "above 100 not acceptable (Tischler and Remple).",
    "worst free-run fit": "Share of an unseen motion that the model predicts without looking, "
    "in the record that it predicts worst.",
    "worst TIC": "Theil's inequality coefficient: 0 is a perfect prediction, below 0.25 to 0.30 is "
    "good.",
    "J_rms": "Root mean square of prediction errors over all outputs.",
    "coherence": "Share of the output's power that the input explains, frequency by frequency.",
    "phase margin": "Delay that the loop stands before it oscillates, as an angle at crossover.",
    "phase margin as flown": "The same with the gains of the log.",
    "gain margin": "How much the loop's gain may grow before it oscillates.",
    "gain margin as flown": "The same with the gains of the log.",
    "crossover": "Frequency up to which a loop works against errors.",
    "sensitivity peak": "How much the loop makes its worst disturbance larger.",
    "damping": "1 is a motion that dies without swinging, below 0 one that grows.",
    "insensitivity": "How far a parameter may move before the cost notices, percent of it.",
    "Cramér–Rao": "Least standard error that the data allow, percent of the value.",
    "chance": "Probability of so large a difference between equal truths.",
    "TIC": "Theil's inequality coefficient: 0 is a perfect prediction, below 0.25 to 0.30 is good.",
}
"""Words by heading."""
