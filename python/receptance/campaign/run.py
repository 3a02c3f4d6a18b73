"""A campaign: structures, measurements and unknowns, and the analyses that they allow."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pkgutil import resolve_name
from typing import Any, Literal

import receptance
from receptance import campaign, coupling, diagnosis
from receptance.campaign.data import CampaignData
from receptance.campaign.identification import fit_options, identify_campaign, invert_campaign, transfer_errors
from receptance.campaign.problems import errors_about
from receptance.fit import Identification, Observation

_PAGE = "receptance.app:NotebookPage"
"""The page in a notebook, which is above this layer; imported when it is opened."""


class Campaign(CampaignData):
    """A measuring campaign, read from a file with `Campaign.load`.

    Its data are those of `CampaignData`; its methods are the analyses.

    Examples
    --------
    >>> import tempfile
    >>> from receptance import campaign, examples
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = examples.write("er32", folder)
    ...     er32 = campaign.Campaign.load(folder)
    >>> er32
    Campaign('The ER32 collet holder, published natural frequencies', 13 assemblies, 13 measurements, 8 held out)
    >>> found = er32.identify()
    >>> round(found.values["joint_d12.k_theta"], -3)
    104000.0
    """

    def base_model(self, seen: Mapping[str, Observation] | None = None) -> tuple[diagnosis.Model, list[str]]:
        """Return the model for a diagnosis, and notes on unknowns that are left out.

        Parameters
        ----------
        seen : mapping of str to Observation, optional
            Measurements that are used; by default those that are not held out.
        """
        return campaign.diagnosis.base_model(self, seen)

    def identify(self, profiles: Sequence[str] | None = None) -> Identification:
        """Identify the unknowns on the measurements that are not held out.

        Parameters
        ----------
        profiles : sequence of str, optional
            Addresses whose profile likelihoods are computed. By default those of the joints, where they are expected to
            take no more evaluations than the fit, unless `settings.profiles` is false.

        Raises
        ------
        CampaignError
            There are no unknowns or no measurements, or more unknowns than measured values; a parameter to profile that
            is not identified. It is a ValueError.
        ReceptanceError
            The model cannot be evaluated at any of the starts.
        """
        return identify_campaign(self, profiles)

    def spindle(
        self,
        name: str | None = None,
        *,
        modes: int | Sequence[float] | Literal["auto"] | None = None,
        limit: float = 0.2,
    ) -> campaign.SpindleIdentification:
        """Identify a spindle from the FRFs of its blanks, line by line, and as modes.

        Held-out FRFs of the blanks are compared with the result. A campaign whose other assemblies end with the spindle
        is loaded with `unidentified=True` before its file is written, `coupling.write_spindle(file, found.identified)`.

        Parameters
        ----------
        name : str, optional
            Name of the spindle; needed if several have blanks.
        modes : int, sequence of float or "auto", optional
            Number of modes, or their approximate frequencies in Hz; "auto" for as many as `modal.fit_modes` finds. By
            default no modes are fitted.
        limit : float, optional
            As in `receptance.coupling.identify_spindle`.

        Raises
        ------
        CampaignError
            No blanks; too few or contradicting FRFs; or as in `identify_spindle` and `fit_spindle`.
        """
        count = None if modes == "auto" else modes
        return campaign.spindle.spindle_of_campaign(self, name, count, as_modes=modes is not None, limit=limit)

    def invert(
        self,
        joint: str | None = None,
        *,
        limit: float = 0.2,
    ) -> coupling.InverseCouplings:
        """Solve for the stiffness of joints on each frequency line, by inverse coupling.

        The FRFs that are not held out are used. With fewer FRFs than unknown terms, k_theta is solved for first, then
        k_y.

        Parameters
        ----------
        joint : str, optional
            Name of a joint; by default all joints with unknown stiffnesses.
        limit : float, optional
            As in `receptance.coupling.invert_coupling`.

        Raises
        ------
        CampaignError
            No such joint was measured with an FRF, or the FRFs have no lines in common.
        """
        return invert_campaign(self, joint, limit)

    def compare(
        self,
        candidates: receptance.sweep.Candidates,
        *,
        given: Mapping[str, float] | None = None,
        store: str | os.PathLike[str] | None = None,
    ) -> campaign.Comparison:
        """Compare many values of parameters with the measurements that are not held out.

        Unknowns that neither vary nor have a given value are identified first, together with those that vary, and keep
        their identified values.

        Parameters
        ----------
        candidates : Grid, Listed or Sampled
            Values of parameters, by address; see `receptance.sweep`.
        given : mapping of str to float, optional
            Values of other parameters in SI units, by address.
        store : path, optional
            As in `receptance.sweep.sweep`.

        Raises
        ------
        CampaignError
            No measured assembly has a parameter; or as in `identify`.
        SweepError
            As in `receptance.sweep.sweep`.
        """
        return campaign.comparison.compare_candidates(self, candidates, given=given, store=store)

    def next_measurement(
        self,
        identified: Identification | None = None,
        *,
        targets: Sequence[str] = (),
    ) -> receptance.predict.NextMeasurement:
        """Rank the candidates by the expected uncertainty of unknowns or predictions after each of them.

        Without candidates those of `receptance.predict.Menu` are ranked, which can be made on what was measured.

        Parameters
        ----------
        identified : Identification, optional
            Result of `identify`; computed if it is not given.
        targets : sequence of str, optional
            Names of unknowns, or of assemblies for their natural frequencies; by default all unknowns.

        Raises
        ------
        CampaignError
            A target does not exist, no candidate of the menu can be simulated, or as in `identify`.
        """
        return campaign.next_measurement.next_measurement_of(self, identified, targets)

    def trial(self, identified: Identification | None = None) -> campaign.Trial:
        """Return the model at chosen values beside the measurements: at those of an identification, or at the starts.

        Raises
        ------
        CampaignError
            There are no measurements or no unknowns.
        """
        return campaign.Trial.of(self, identified)

    def open(self) -> Any:
        """Show the page of the campaign in a notebook; its folder, with what was saved there.

        The page has the same parts as that of `receptance open`, and is served until the kernel ends, or until the
        `close` of what is returned.

        Returns
        -------
        NotebookPage
            Shown by the notebook as the last value of a cell; it has the `address` of the page.

        Raises
        ------
        MissingExtraError
            The extra `app` is not installed.
        ReceptanceError
            This is no notebook.
        """
        return resolve_name(_PAGE)(self.file.absolute(), threads=self.threads)

    def predict(self, identified: Identification | None = None) -> campaign.Prediction:
        """Predict held-out measurements and assemblies without measurements.

        Parameters
        ----------
        identified : Identification, optional
            Result of `identify`; computed if it is not given and there are unknowns.

        Raises
        ------
        CampaignError
            No measurement is held out and every assembly was measured; no prediction is possible; or as in `identify`.
        """
        return campaign.prediction.predict_campaign(self, identified)

    def stability(
        self, identified: Identification | None = None, *, cuts: Sequence[str] = ()
    ) -> receptance.stability.Stability:
        """Compute stable depths of cut over spindle speed with bands, and recommended speeds.

        Parameters
        ----------
        identified : Identification, optional
            Result of `identify`; computed if it is not given, there are unknowns and a tip is predicted.
        cuts : sequence of str, optional
            Names of cuts; by default all.

        Raises
        ------
        CampaignError
            There are no cuts or no speeds, a cut does not exist, or as in `identify`.
        """
        return campaign.stability.stability_of_campaign(self, identified, cuts=cuts)

    def transfer(
        self,
        *,
        splits: Literal["leave-one-out", "one-for-all"] = "leave-one-out",
        draws: int = 200,
    ) -> receptance.predict.Transfer:
        """Predict every measured assembly from the others; roles of measurements are ignored.

        Parameters
        ----------
        splits : {"leave-one-out", "one-for-all"}, optional
            Each assembly from all others, or all others from each.
        draws : int, optional
            As in `receptance.predict.transfer`.

        Raises
        ------
        CampaignError
            There are no unknowns, fewer than two assemblies were measured, or as in `identify`.
        """
        tolerances = transfer_errors(self)
        notes = list(self.notes)
        if self.held_out:
            notes.append('the role "hold out" is ignored, because each assembly is held out once')
        settings, observations = self.table.settings, list(self.measurements.values())
        _, unknowns, tolerances, options, _ = fit_options(self, observations, self.unknowns, tolerances)
        with errors_about(self.file):
            transferred = receptance.predict.transfer(
                observations,
                unknowns,
                tolerances=tolerances,
                splits=splits,
                level=self.table.prediction.level,
                draws=draws,
                seed=settings.seed,
                progress=self.progress,
                **options,
            )
        provenance = self.provenance(settings=settings.data())
        return replace(transferred, campaign_notes=tuple(dict.fromkeys(notes)), provenance=provenance)

    def diagnose(
        self,
        causes: Iterable[diagnosis.Cause | str] | None = None,
        *,
        fast: bool = False,
        metrics: Mapping[str, diagnosis.Metric] | None = None,
    ) -> diagnosis.Verdict:
        """Test whether the model explains the measurements, and find the cause if it does not.

        Errors of dimensions and materials are fitted with their tolerances as priors. A cause is judged by how much it
        improves predictions: of held-out measurements, or of assemblies that are left out in turn if none is held out.

        Parameters
        ----------
        causes : sequence of Cause and str, optional
            Causes or their ids; by default all of `receptance.diagnosis.CATALOGUE`.
        fast, metrics
            As in `receptance.diagnosis.diagnose`; metrics are of held-out measurements as well.

        Raises
        ------
        CampaignError
            There are no unknowns or no measurements, or measurements have no standard deviations. It is a ValueError.
        """
        return campaign.diagnosis.diagnose_campaign(self, causes, fast, metrics)


load = Campaign.load
"""`Campaign.load`, as a function."""
