"""All thresholds and grids of the diagnosis, with meaning and unit.

Evidence and chi-square are dimensionless; so are standard deviations of the logarithm of a receptance. The blind
laboratory (`tests/blind`) checks them together: see `docs/validation_diagnosis.md`.
"""

from __future__ import annotations

# Lines of measured receptances.

EXPLORING_LINES = 120
"""Lines of each receptance of the first fits of the base, and of simulated measurements."""
BLOCKS = 120
"""Blocks of each receptance, about, in the data that are compressed about a fit."""

# Fits.

EVALUATIONS = 100
"""Most evaluations of a fit on all lines, and of one of the errors of a prediction."""
EVALUATIONS_OF_BASE = 200
"""Most evaluations from each start of the base on few lines."""
CONTINUED_BASE = 4
"""Most continuations of the base on all lines, each with as many evaluations, while it is neither converged nor
adequate."""
AT_BOUND = 1e-6
"""Largest distance from a bound, as a share of the range, of a variable that the bound may hold."""
EVALUATIONS_EXPLORING = 30
"""Most evaluations of a fit on few lines."""
TOLERANCE_OF_BASE = 1e-10
"""Relative change of the cost and of the variables at which the base on few lines has converged."""
EVALUATIONS_OF_START = 8
"""Evaluations that every start gets on few lines before the starts are compared."""
LARGE_SIZE = 3.0
"""Large sizes from which fits start, as a multiple of the typical size."""
WORSE_LEVEL = 1.5
"""Ratio of the misfits of neighbouring levels from which a level is fitted from its own starting values as well."""

# Adequacy.

LEAST_FREEDOM = 3
"""Fewest degrees of freedom that judge a model: with two, a misfit of 6.9 passes the test at `CHANCE`."""
# Screening to first order.

CHANCE_DRAWS = 20000
"""Draws of residuals for the detection threshold."""
VARIANTS_FITTED = 3
"""Variants of each cause that are fitted, the highest predicted evidence first."""
PREDICTED_SHARE = 0.1
"""Share of the highest predicted evidence below which a variant is not fitted, where predictions are reliable."""
COLUMNS_TOGETHER = 64
"""Largest number of derivatives of all residuals that screening evaluates at once: it bounds memory."""
INVISIBLE = 1e-8
"""Norm of a derivative, relative to the largest one of the variant, below which the data do not show a parameter."""
DEPENDENT = 1e-5
"""Singular value of the derivatives of a variant, in units of their norms and relative to the largest one, below which
they have the same effect: products of derivatives do not resolve smaller differences."""

# Selection.

MARGIN = 10.0
"""Difference of evidence within which explanations are reported together, and below which a gain on few lines does not
justify a fit on all lines."""
MARGIN_OF_ALTERNATIVE = 5.0
"""Difference of evidence within which an alternative raises a doubt. It is smaller than the margin between causes,
because the causes of the catalogue are more frequent than other errors."""
ADDED_CAUSES = 6
"""Further causes that are fitted with each of them."""
SCREENING_LIMIT = 20.0
"""Misfit above which linear screening and short fits are unreliable, so every variant is fitted on all lines."""
LEADING_CAUSES = 4
"""Explanations, the highest evidence first, with which a search goes on: other modes are chosen beside them, they are
fitted again from their own starting values, and they are kept where a race is interrupted."""
BEHIND = 60.0
BEHIND_SHARE = 0.3
"""An explanation is only evaluated on all lines if its chi-square on few lines exceeds the best one by no more than
BEHIND plus this share of the gain of the best one. By the same rule on all lines no cause is added to it, and on the
other configurations it is left out of a fold."""

CONTINUED_SHARE = 1.0 / 3.0
LEAST_CONTINUED = 12
"""Share of the rivals of a race, and least number of them, that get further starts after the short fits."""

# Alternatives that are not causes.

ALTERNATIVE_PLACES = (0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)
"""Places on tool and holder, as shares of the length, of the shortest one where a tool has several overhangs."""

# The discrepancy of a model.

LEAST_SHARE = 0.5
"""Least share of the misfit that a cause takes where it explains the data partly."""
BEYOND_NOISE = 4.0
"""Misfit of the base from which a cause is reported beside a discrepancy: the errors of the model are twice the noise.
Beside smaller errors foreign effects have been reported as causes."""
DISCREPANCY_SELECTIONS = 3
"""Most selections beside a discrepancy, each with the one that is left with the best cause of the selection before."""
DISCREPANCY_CAUSES = 8
"""Causes whose own discrepancy is estimated after each selection."""
# The verdict.

ONE_CONFIGURATION = 0.97
"""Share of the improvement in one configuration from which a cause of the structure is suspected only."""
STRAIN_CHANCE = 1e-2
"""Probability of the strain of the tolerances below which a cause is suspected only: a wrong cause leaves an effect
that the tolerances absorb."""
LISTED = 3
"""Number of vetoed causes that are listed, and of causes alone whose improvement is measured in each fold, the highest
evidence first."""
LOOK_ALIKE = 0.9
"""Cosine between the effects of two causes from which they are listed as look-alikes."""

# Predictions, held-out data and residuals by mode.

FOLDS = 4
"""Most folds; each repeats the choice among the leading explanations."""
CIRCLE_WIDTHS = 4.0
"""Half-power widths on each side of a peak over which a circle is fitted."""
BIAS_CONFIGURATIONS = 3
"""Fewest configurations whose errors are tested for a common sign."""
BIAS_CHANCE = 0.05
"""Probability, corrected for the number of tests, up to which a bias is reported."""
LEAST_BIAS = 0.02
"""Smallest bias that is reported, in percent."""

# Truncated records.

TRUNCATION_STEP = 2.5
"""Ratio of the power before and after an instant from which the record is truncated there."""
TRUNCATION_WINDOW = 0.05
"""Length of the windows that are compared, as a share of the period."""
TRUNCATION_FROM = 0.3
"""Earliest truncation, as a share of the period."""
TRUNCATION_POINTS = 400
"""Instants of a period."""
UNEVEN_LINES = 0.02
"""Largest deviation of a line from a multiple of the spacing, in spacings."""

# Grids and steps of the variants.

SAME_PLACE = 1e-9
"""Distance in m below which two places are the same."""
VARIED = 1.05
"""Ratio of the largest and the smallest value from which a condition has been varied."""
PIECES = 6
"""Pieces of equal length: of tool and holder, of a taper, and of the springs along a contact, if their points allow."""
SHORT_SECTION = 1e-3
"""Length in m of the shortest section that a change adds to a part."""
START_LENGTH = 1e-4
"""Length in m of a contact at the start of a fit of a spread joint. A step that is nearer to a hit or a rope does not
bound its place, because it is the start of another fit."""
LAYER_POINTS = 12
"""Points that stand for a layer whose stiffness changes along the insertion."""
SENSOR_SHARE = 0.05
"""Largest plausible mass of a forgotten sensor, as a share of the mass of the tool, where this is more than usual."""
COLLET_GYRATION = 0.6
"""Radius of gyration of a collet as a multiple of the shank's diameter."""
COLLET_SHAPE = 0.5
"""Standard deviation of the natural logarithm of its moment of inertia. A thin ring around the shank has a radius of
gyration of 0.35 diameters, a collet with its nut of about one diameter: two standard deviations to either side."""
TIP_STEP = 1e-5
"""Distance in m from the tip, or from a place on the tool, of a new step between sections."""
SHORTENED = 0.98
"""Share of a length by which a cause may shorten it: the tool behind its last place, and the mouth of the holder."""
METAL_MODULUS = 2e11
"""Young's modulus in Pa from which the decades of a rigid body's stiffness count; from ten times of it on a body is
rigid, because no material reaches that."""
RESONANCE_STEP = 0.08
"""Distance of the trial frequencies of a resonator, as a natural logarithm."""
ORDINARY_MODULUS = 0.15
ORDINARY_DENSITY = 0.1
"""Natural logarithms up to which a change is an error of the stated material and not another material. Beside another
cause, a difference of holder or spindle from its drawing is named up to `ORDINARY_DENSITY`."""
DRAWING = 0.25
"""Largest share by which effective density and modulus of holder and spindle plausibly differ from a simplified
drawing, which leaves out bores, flanges and balancing cut-outs."""
MATERIAL_DEVIATIONS = 4.0
"""Plausible range of a material, in standard deviations of its grades."""
SUSPENSION_PLACES = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)
"""Places of a suspension, as shares of the holder's length."""
