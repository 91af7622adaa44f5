"""The command "torquer", or python3 -m torquer."""

import argparse
import json
import sys
from typing import Any

from . import Error, __version__, _command, baselines, benchmark, centerlines, envs, export, guide3d, steve
from ._names import did_you_mean, shown


def _add_baselines(commands: Any) -> None:
    """Adds the commands train and evaluate."""
    teach = commands.add_parser("train", help="train a policy for a task of stEVE_bench, with python3-torch")
    teach.add_argument("task", metavar="TASK", help=f"the task: {', '.join(steve.NAMES)}")
    teach.add_argument("policy", metavar="POLICY", help="file of the policy to write, .npz")
    teach.add_argument("--realistic", action="store_true", help="stiffness and friction of real devices")
    teach.add_argument("--steps", type=int, default=150_000, metavar="N", help="steps of the training (default: 150000)")
    teach.add_argument("--seed", type=int, default=1, metavar="N", help="seed of the training (default: 1)")
    test = commands.add_parser("evaluate", help="test policies of torquer train in held-out episodes")
    test.add_argument("policies", metavar="POLICY", nargs="*", help="files of policies")
    test.add_argument("--pushed", metavar="TASK", help=f"also test pushing alone in a task: {', '.join(steve.NAMES)}")
    test.add_argument("--taught", metavar="TASK", help="also test the teacher of torquer train, which sees the whole state")
    test.add_argument(
        "--realistic", action="store_true", help="--pushed, --taught: stiffness and friction of real devices"
    )
    test.add_argument("--episodes", type=int, default=100, metavar="N", help="episodes of each policy (default: 100)")
    test.add_argument("--training", action="store_true", help="steps as accurate as in the training, and faster")
    test.add_argument("--json", action="store_true", help="print one line of JSON")


def _train(arguments: argparse.Namespace) -> int:
    baselines.train(
        arguments.task, arguments.policy, arguments.realistic, arguments.steps, arguments.seed, sys.stderr
    )
    print(f"policy: {arguments.policy}")
    return 0


def _evaluate(arguments: argparse.Namespace) -> int:
    others = ((arguments.pushed, baselines.pushed, "only pushed"), (arguments.taught, baselines.taught, "teacher"))
    asked = [(name, arguments.realistic, begin, label) for name, begin, label in others if name]
    if not arguments.policies and not asked:
        raise Error("there is nothing to test; give a POLICY, --pushed TASK or --taught TASK")
    if arguments.realistic and not asked:
        raise Error("--realistic is for --pushed and --taught; a POLICY has its own task")
    for path in arguments.policies:
        policy = baselines.load(path)
        label = f"{path}, seed {policy.seed}, {policy.curve[-1][0]:.0f} steps"
        asked.append((policy.task, policy.realistic, policy.begin, label))
    rows = []
    for name, realistic, begin, label in asked:
        found = baselines.evaluate(name, realistic, begin, arguments.episodes, arguments.training, sys.stderr)
        rows.append({**found, "policy": label})
    print(json.dumps(rows) if arguments.json else baselines.as_table(rows))
    return 0


def main() -> int:
    parser = argparse.ArgumentParser(
        prog="torquer", description="Converts wires and vessels to other formats, measures environments, and trains policies for them."
    )
    parser.add_argument("--version", action="version", version=f"torquer {__version__}")
    commands = parser.add_subparsers(dest="command", required=True)
    convert = commands.add_parser(
        "convert",
        help="convert a --states file to .pvd, .vtp, .mrk.json or .csv, or centerlines of VMTK (.vtp) "
        "to a new folder of curves for a scene, or guide3d FOLDER to shapes for torquer-validate",
    )
    convert.add_argument("source", metavar="IN", help="file to read; or guide3d, and then the folder of that public data")
    convert.add_argument("target", metavar="OUT", help="file or folder to write; the folder to read after guide3d")
    convert.add_argument("shapes", metavar="SHAPES", nargs="?", help="new folder for the shapes of guide3d (default: guide3d-shapes)")
    convert.add_argument(
        "--unit", choices=centerlines.UNITS, help="unit of the coordinates in a .vtp (default: mm; SimVascular: cm)"
    )
    speed = commands.add_parser(
        "benchmark", help="measure the steps per second and the error of the environments in torquer.envs"
    )
    speed.add_argument("--json", action="store_true", help="print one line of JSON")
    speed.add_argument("tasks", metavar="TASK", nargs="*", help=f"tasks to measure: {', '.join(envs.TASKS)} (default: all)")
    _add_baselines(commands)
    arguments = parser.parse_args()
    try:
        if arguments.command == "train":
            return _train(arguments)
        if arguments.command == "evaluate":
            return _evaluate(arguments)
        if arguments.command == "benchmark":
            for name in arguments.tasks:
                if name not in envs.TASKS:
                    near = did_you_mean(name, envs.TASKS)
                    raise Error(f"there is no task {shown(name)}; {near}there are: {', '.join(envs.TASKS)}")
            result = benchmark.run(arguments.tasks)
            print(benchmark.as_json(result) if arguments.json else benchmark.as_table(result))
            return 0
        target = arguments.target
        if arguments.source == "guide3d":
            if arguments.unit:
                raise Error("--unit is for centerlines in a .vtp; leave it out after guide3d")
            target = arguments.shapes or "guide3d-shapes"
            written = guide3d.convert(arguments.target, target)
        elif arguments.shapes:
            raise Error(f"{arguments.shapes}: only guide3d takes a third name; leave it out")
        elif arguments.source.endswith(".vtp"):
            written = centerlines.convert(arguments.source, arguments.target, arguments.unit or "mm")
        elif arguments.unit:
            raise Error(f"--unit {arguments.unit} is for centerlines in a .vtp, but {arguments.source} is no .vtp; leave it out")
        else:
            written = export.write(export.read_states(arguments.source), arguments.target)
    except Error as error:
        print(f"torquer: {error}", file=sys.stderr)
        return 2
    print(f"{target}: {written}")
    return 0


def command() -> int:
    """The command torquer: its exit status."""
    return _command.run("torquer", main)


if __name__ == "__main__":
    sys.exit(command())
