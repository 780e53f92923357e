"""Run a campaign from its scenario: `vs.run("scenarios/quick.toml", "quick.zarr")`, as `vestige run` does."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

from vestige.campaign.run import ExecutorChoice, RunProgress, run
from vestige.campaign.scenario_plan import ScenarioPlan
from vestige.campaign.store.results import Results, open_results
from vestige.errors import VestigeError
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.load import load_scenario


def run_scenario(
    scenario: CampaignScenario | Path | str,
    store: Path | str,
    *,
    settings: Iterable[str] = (),
    workers: int = 1,
    executor: ExecutorChoice = "threads",
    progress: Callable[[RunProgress], None] | None = None,
) -> Results:
    """Run a campaign, keep its results in a folder, and return them; `vestige run` does the same.

    A run that was stopped goes on when it is called again, and ends with the same bits. The number of workers changes
    no bit either.

    Parameters
    ----------
    scenario
        Campaign, or the path of its file.
    store
        Folder of the results (zarr). It is made if it does not exist.
    settings
        Values that replace those of the file, `table.key=value` each. They need a file.
    workers
        Number of threads or processes.
    executor
        `"threads"`, `"processes"`, or an executor of your own, which is left open. With processes, a script needs
        `if __name__ == "__main__":`.
    progress
        Function that is called at the beginning and after each chunk of epochs.

    Returns
    -------
    Results
        Columns of n epochs × m satellites, and the scenario.

    Raises
    ------
    InputFileError
        If the file describes no scenario, or the folder holds something else than a part of this campaign.
    VestigeError
        If the scenario is no campaign, or workers are lost.
    ValueError
        If there are settings for a campaign that was not read from a file.

    See Also
    --------
    open_results : Open results that were stored before.
    simulate : Go through the snapshots of a campaign without keeping anything.

    Examples
    --------
    >>> import vestige as vs
    >>> results = vs.run("scenarios/quick.toml", "quick.zarr", settings=["epochs=100", "receiver.cn0_dbhz=45"])
    >>> results.status.shape
    (100, 1)
    >>> int((results.status == list(vs.Status).index(vs.Status.AUTHENTIC)).sum())
    100
    """
    settings = tuple(settings)
    if not isinstance(scenario, CampaignScenario):
        loaded = load_scenario(scenario, settings)
        if not isinstance(loaded, CampaignScenario):
            raise VestigeError(f'{scenario}: found kind = "{loaded.kind}", expected "campaign"')
        scenario = loaded
    elif settings:
        raise ValueError("settings replace values of a file, but the campaign is not read from one")
    plan = ScenarioPlan(scenario=scenario)
    run(plan, store, workers=workers, executor=executor, chunk_epochs=plan.chunk_epochs, progress=progress)
    return open_results(store, verify=False)
