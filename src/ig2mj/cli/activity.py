"""`ig2mj activity`: BEHAVIOR's activities: list them, show what each requires, sample their start states."""

from __future__ import annotations

import pathlib
import sys
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from ig2mj.cli.activity_pools import sample
from ig2mj.cli.common.bindings import binding_as_text, find_homes
from ig2mj.cli.common.deprecated import renamed_options

if TYPE_CHECKING:
    from ig2mj.tasks.bddl.binding import Binding
    from ig2mj.tasks.bddl.vocabulary import Activity

Flag = Annotated[bool, tyro.conf.FlagCreatePairsOff]


def list_(behavior1k: Flag = False, json: Flag = False) -> None:
    """List the activities, and the shipped homes in which each can be done.

    Args:
      behavior1k: list BEHAVIOR-1K's activities instead of BEHAVIOR-100's; run `ig2mj activity fetch` first.
      json: print JSON instead of a table.
    """
    from ig2mj.cli.common.printing import make_table, print_json, stdout_console
    from ig2mj.tasks.bddl.definitions import activity_names, load_activity
    from ig2mj.tasks.bddl.start import fitting
    from ig2mj.tasks.bddl.vocabulary import VocabularyError

    names = activity_names(behavior1k)
    homes = find_homes(None)
    found: list[dict[str, Any]] = []
    for name in names:
        try:
            activity = load_activity(name, behavior1k)
        except VocabularyError as e:
            found.append({"activity": name, "lacks": list(e.predicates)})
            continue
        bound, _ = fitting(activity, homes)
        best = bound[0] if bound else None
        found.append(
            {
                "activity": name,
                "objects": sum(map(len, activity.objects.values())),
                "homes": [b.home for b in bound],
                "added": len(best.additions) if best else None,
            }
        )
    if json:
        print_json(found)
        return
    fit = sum(bool(row.get("homes")) for row in found)
    title = f"{len(found)} activities; {fit} can be bound in a shipped home (ig2mj activity show NAME)"
    rows = [
        (row["activity"], row.get("objects", "-"), len(row.get("homes", ())) or "-",
         "-" if row.get("added") is None else row["added"],
         f"no state for {', '.join(row['lacks'])}" if "lacks" in row else ", ".join(row["homes"]))
        for row in found
    ]  # fmt: skip
    console = stdout_console()
    console.print(make_table(title, ("activity", ">objects", ">homes", ">to add", "?where"), rows, console.width))


@renamed_options({"--picture": "--image"})
def show(
    name: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="ACTIVITY")],
    scene: Annotated[str | None, tyro.conf.arg(metavar="HOME")] = None,
    behavior1k: Flag = False,
    pool: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="POOL.npz")] = None,
    row: int = 0,
    image: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="FILE")] = None,
    json: Flag = False,
) -> int:
    """Show what an activity requires and which objects of a home it uses; or what is false in a row of a pool.

    The exit status is 1 if the home lacks what the activity needs (without --scene: if every shipped home does).

    Args:
      name: the activity's name, or a BDDL file of your own.
      scene: the home; default: the shipped home that needs the fewest additional objects.
      behavior1k: look the name up in BEHAVIOR-1K instead of BEHAVIOR-100; some names occur in both.
      pool: a pool made by `ig2mj activity sample`; show which goal conditions are false in one of its rows.
      row: which row of the pool.
      image: also write an image of that row.
      json: print JSON instead of text.
    """
    from ig2mj.cli.activity_pools import show_row
    from ig2mj.cli.common.printing import print_json
    from ig2mj.errors import Ig2mjError
    from ig2mj.tasks.bddl.definitions import load_activity
    from ig2mj.tasks.bddl.start import fitting
    from ig2mj.worlds.pool import scene_name

    activity = load_activity(name, behavior1k)
    if pool is not None:
        if image is not None:
            from ig2mj.cli.common.files import check_image

            check_image(image)
        found, errors = fitting(activity, find_homes(scene or scene_name(pool)))
        if not found:
            raise Ig2mjError(" ".join(line.strip() for line in binding_as_text(None, [], errors)))
        show_row(found[0], pool, row, image, scene, json)
        return 0
    if image is not None or row:
        raise Ig2mjError("--row and --image need --pool")
    bound, errors = fitting(activity, find_homes(scene))
    best = bound[0] if bound else None
    if json:
        print_json(_as_data(activity, best, errors))
    else:
        print("\n".join([*_as_text(activity), "", *binding_as_text(best, [b.home for b in bound], errors)]))
    return 0 if best else 1


def fetch() -> None:
    """Download BEHAVIOR-1K's definitions (bddl 3.6.0, MIT, 2 MB by pip) into the user's cache."""
    from ig2mj.tasks.bddl import behavior1k
    from ig2mj.tasks.bddl.definitions import activity_names

    folder = behavior1k.fetch()
    print(f"{folder}: {len(activity_names(behavior_1k=True))} activities (ig2mj activity list --behavior1k)")


def coverage(
    names: Annotated[tuple[str, ...], tyro.conf.Positional, tyro.conf.arg(metavar="ACTIVITY")] = (),
    results: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="DIR")] = None,
    sample: Flag = False,
    seconds: float = 60.0,
    seeds: int = 10,
    minutes: float = float("inf"),
    jobs: int = 1,
    page: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="FILE.md")] = None,
    json: Flag = False,
) -> None:
    """Count BEHAVIOR-1K's definitions that can be expressed, that fit a home, and whose start can be sampled.

    Run `ig2mj activity fetch` first.

    Args:
      names: only these definitions; default: all.
      results: folder of what was sampled, one file for each definition; a definition goes on where it was.
      sample: sample start states of definitions that fit into --results. All of them take hours of processor time.
      seconds: wall time for each seed.
      seeds: with how many of the 10 seeds; a first run with 1 shows what fails.
      minutes: after which no further definition is begun.
      jobs: number of processes; 0: one per processor.
      page: write a page of documentation with every definition.
      json: print JSON instead of a table.
    """
    from ig2mj.cli.common.files import check_output
    from ig2mj.cli.common.printing import add_bar, make_table, print_json, progress_bar, stdout_console
    from ig2mj.errors import Ig2mjError, UnknownNameError
    from ig2mj.tasks.bddl import coverage as all_of_it
    from ig2mj.tasks.bddl.definitions import activity_names

    if sample and results is None:
        raise Ig2mjError("--sample needs --results DIR, where results are kept")
    if not 1 <= seeds <= all_of_it.SEEDS:
        raise Ig2mjError(f"--seeds {seeds}: from 1 to {all_of_it.SEEDS}")
    if page is not None:
        check_output(page)
    known = activity_names(True)
    if unknown := [name for name in names if name not in known]:
        raise UnknownNameError("activity", unknown[0], known)
    homes = find_homes(None)
    with progress_bar() as bar:
        rows = all_of_it.cover(homes, results, names or None, add_bar(bar, "binding definitions"))
        if sample and results is not None:
            unsampled = [row.name for row in rows if row.homes and row.sampled is None]
            report = add_bar(bar, "sampling start states")
            failed = all_of_it.sample_definitions(
                unsampled, [home.name for home in homes], results, seconds, seeds, minutes, jobs, report
            )
            for name, why in failed.items():
                print(f"{name}: {why}", file=sys.stderr)
            rows = all_of_it.cover(homes, results, names or None)
    if page is not None:
        page.write_text(all_of_it.page(rows), encoding="utf-8")
    found = all_of_it.counts(rows)
    if json:
        lacks = {row.name: row.why_not for row in rows if row.why_not}
        more = {"lacking": all_of_it.lacking(rows), "missing": all_of_it.missing(rows), "why_not": lacks}
        print_json({**found, **more})
        return
    console = stdout_console()
    columns = tuple(f">{name}" for name in found)
    console.print(make_table("BEHAVIOR-1K", columns, [tuple(found.values())], console.width))
    for title, table in (("not expressed", all_of_it.lacking(rows)), ("no object for", all_of_it.missing(rows))):
        if table:
            first = list(table.items())[:15]
            console.print(make_table(f"{title} (definitions that lack only this)", ("?what", ">definitions"), first,
                                     console.width))  # fmt: skip


SUBCOMMANDS = {"list": list_, "show": show, "sample": sample, "fetch": fetch, "coverage": coverage}


def _as_text(activity: Activity) -> list[str]:
    from ig2mj.tasks.bddl.words import INDENT, sentences

    names = [name for found in activity.objects.values() for name in found]
    rooms = [f"{INDENT}{name} in a {kind}" for name, kind in activity.rooms.items()]
    return [
        f"{activity.name} ({'BEHAVIOR-1K' if activity.behavior_1k else 'BEHAVIOR-100'}, {len(names)} objects)",
        *([f"  note: {remark}" for remark in activity.remarks]),
        *(["", "where:", *rooms] if rooms else []),
        *("", "at the start:"),
        *sentences(activity.init, INDENT),
        *("", "goal:"),
        *sentences(activity.goal, INDENT),
    ]


def _as_data(activity: Activity, best: Binding | None, errors: dict[str, list[str]]) -> dict[str, Any]:
    from ig2mj.predicates.logic import text

    return {
        "activity": activity.name,
        "objects": activity.objects,
        "rooms": activity.rooms,
        "init": [text(c) for c in activity.init],
        "goal": [text(c) for c in activity.goal],
        "binding": None
        if best is None
        else {
            "home": best.home,
            "objects": best.objects,
            "rooms": best.rooms,
            "additions": best.additions,
            "stand_ins": best.stand_ins,
        },
        "not_bound": errors,
    }
