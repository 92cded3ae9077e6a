"""``sccal simulate``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from sccal.cli.app import app
from sccal.errors import UsageError


@app.command()
def simulate(
    out: Annotated[Path, typer.Argument(help="Folder for the run; its name is the run's.", show_default=False)],
    path: Annotated[
        str, typer.Option(help="general, calibration, rectangle, circle, straight, figure8 or rows.")
    ] = "general",
    duration: Annotated[float, typer.Option(help="Length of the drive, s.", min=10.0)] = 600.0,
    seed: Annotated[int, typer.Option(help="Same seed, same bytes.", min=0)] = 0,
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", help="Any other setting, e.g. ahrs.heading_offset_deg=137 (repeatable; see --list)."),
    ] = None,
    effect: Annotated[
        list[str] | None,
        typer.Option(help="Put an effect into the log, e.g. lever_arm=0.3,-0.1 (repeatable; see `sccal effects`)."),
    ] = None,
    show: Annotated[bool, typer.Option("--list", help="List the settings and their defaults.")] = False,
    samples: Annotated[bool, typer.Option("--samples", help="Make the sample runs in OUT instead.")] = False,
) -> None:
    """A tracked robot's logs with known truth: encoder.csv, ahrs.csv, gnss.nmea, vehicle.toml and truth.json."""
    from sccal.effects.catalogue import parse_effect
    from sccal.simulate.choose import describe_settings, settings_from
    from sccal.simulate.files import write_run, write_vehicle_file
    from sccal.simulate.run import simulate_run

    if show:
        print("\n".join(describe_settings()))
        return
    if samples:
        from sccal.samples import write_all_samples

        write_all_samples(out)
        print(f"sample runs in {out}/")
        return
    if out.exists() and not out.is_dir():
        raise UsageError(f"{out}: a file of that name is in the way")
    chosen = settings_from(
        [f"drive.path={path}", f"drive.duration_s={duration}", *(settings or [])],
        seed,
    )
    chosen_effects = [parse_effect(text) for text in effect or []]
    simulated = simulate_run(chosen, [one.physics(values) for one, values in chosen_effects])
    write_run(simulated, out)
    write_vehicle_file(chosen, out)
    print(f"a {path} of {duration:g} s in {out}/ (truth in {out / 'truth.json'})")
