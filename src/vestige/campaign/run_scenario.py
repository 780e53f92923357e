"""Run the campaign that a scenario describes, for example `vs.run("scenarios/quick.toml", "quick.zarr")`."""

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
    """Run the campaign of a scenario, store the results in a folder, and return the results.

    The command `vestige run` runs a campaign in the same way as this function. To continue a run that was stopped, call
    the function again with the same arguments. The results have the same bits as the results of a run without
    interruption, with any number of workers.

    Parameters
    ----------
    scenario
        Campaign, or path of its scenario file.
    store
        Folder of the results (zarr). `run` makes the folder if the folder does not exist.
    settings
        Values that replace values of the scenario file, each as `key=value` or `table.key=value`. Settings need a
        scenario file.
    workers
        Number of threads or processes, or number of calls that your own executor runs at the same time.
    executor
        `"threads"`, `"processes"`, or your own executor, which `run` does not shut down. A script that uses
        `"processes"` needs the line `if __name__ == "__main__":`, because each process imports the script.
    progress
        Function that is called with the progress at the beginning of the run and after each measured chunk of epochs.

    Returns
    -------
    Results
        Columns of n epochs × m satellites, and the scenario.

    Raises
    ------
    InputFileError
        If the file describes no scenario, the folder contains anything but results of this campaign and this build of
        vestige, or another process writes into the folder.
    VestigeError
        If the scenario describes no campaign, a worker is lost or has another build of vestige, or the code of a user's
        class fails.
    ValueError
        If there are settings for a campaign that was not read from a file.

    See Also
    --------
    open_results : Open results that were stored before.
    simulate : Go through the snapshots of a campaign without storing results.

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
        raise ValueError("settings replace values of a file, but the campaign was not read from a file")
    plan = ScenarioPlan(scenario=scenario)
    run(plan, store, workers=workers, executor=executor, chunk_epochs=plan.chunk_epochs, progress=progress)
    return open_results(store, verify=False)
