"""The examples of examples/cluster: each is what its tool reads, and says the commands that there are."""

from __future__ import annotations

import pathlib
import re
import shlex
import shutil
import subprocess

import pytest
import yaml
from parsed_commands import parse_only

from ig2mj.cli import train
from ig2mj.cluster.process_topology import find_topology

FOLDER = pathlib.Path(__file__).resolve().parents[2] / "examples" / "cluster"

INSTRUCTIONS = {
    "FROM",
    "RUN",
    "COPY",
    "ENV",
    "WORKDIR",
    "USER",
    "VOLUME",
    "CMD",
    "ARG",
    "LABEL",
    "EXPOSE",
    "ENTRYPOINT",
}


def documents(name: str) -> dict[str, dict]:
    return {d["kind"]: d for d in yaml.safe_load_all((FOLDER / name).read_text())}


def options(words: list[str]) -> set[str]:
    return {word[2:].replace("-", "_") for word in words if word.startswith("--")}


def known() -> set[str]:
    """Options of `ig2mj train`."""
    return set(train.run.__annotations__)


def instructions(text: str) -> list[tuple[str, str]]:
    whole = re.sub(r"\\\n", " ", "\n".join(line for line in text.splitlines() if not line.startswith("#")))
    return [
        (name, rest.strip()) for name, _, rest in (line.partition(" ") for line in whole.splitlines() if line.strip())
    ]


def commands(name: str) -> list[list[str]]:
    """All of an example's commands `ig2mj ...`, also those in comments, with the values that variables default to."""
    text = (FOLDER / name).read_text()
    text = re.sub(r"\\\n#?", " ", text)
    text = re.sub(r"\$\{\w+:-([^}]*)\}", r"\1", text)
    found = [m[1] for m in re.finditer(r"(?:^|[\s\"])(ig2mj (?:[a-z-]+) [^\n]*)", text) if "--" in m[1]]
    return [shlex.split(line)[1:] for line in found]


@pytest.mark.parametrize(("name", "count"), [("Dockerfile", 1), ("raycluster.yaml", 1), ("train.slurm", 1)])
def test_the_commands_of_the_examples_are_parsed(name, count, monkeypatch):
    found = commands(name)
    assert len(found) == count
    for words in found:
        assert parse_only(words, monkeypatch) == 0, words


def test_the_command_of_the_job_is_parsed(monkeypatch):
    (container,) = documents("train-job.yaml")["Job"]["spec"]["template"]["spec"]["containers"]
    first, *words = [*container["command"], *container["args"]]
    assert first == "ig2mj" and parse_only(words, monkeypatch) == 0


def test_the_slurm_script_is_a_script_that_trains():
    file = FOLDER / "train.slurm"
    assert subprocess.run(["bash", "-n", str(file)], capture_output=True).returncode == 0
    lines = file.read_text().splitlines()
    expected = dict(line[len("#SBATCH --") :].partition("=")[::2] for line in lines if line.startswith("#SBATCH --"))
    assert {"nodes", "ntasks-per-node", "gpus-per-node", "time"} <= set(expected)
    command = re.sub(r"\\\n", " ", file.read_text()).split("srun", 1)[1]
    assert options(shlex.split(command.split("ig2mj train")[1])) <= known()
    first = next(n for n, line in enumerate(lines) if line and not line.startswith("#"))
    assert not any(line.startswith("#SBATCH") for line in lines[first:]), "Slurm reads no more after a command"


def test_the_job_gives_every_pod_what_a_process_reads():
    found = documents("train-job.yaml")
    job, service = found["Job"]["spec"], found["Service"]
    (container,) = job["template"]["spec"]["containers"]
    assert job["completionMode"] == "Indexed" and job["completions"] == job["parallelism"]
    environment = {e["name"]: e["value"] for e in container["env"]} | {"JOB_COMPLETION_INDEX": "1"}
    place = find_topology(environment)
    assert place is not None and (place.rank, place.count) == (1, job["completions"])
    assert place.host == f"{found['Job']['metadata']['name']}-0.{service['metadata']['name']}"
    assert (
        job["template"]["spec"]["subdomain"] == service["metadata"]["name"] and service["spec"]["clusterIP"] == "None"
    )
    assert options([*container["command"], *container["args"]]) <= known()


def test_the_ray_cluster_is_one_of_kuberay():
    found = documents("raycluster.yaml")
    cluster, claim = found["RayCluster"], found["PersistentVolumeClaim"]
    assert cluster["apiVersion"] == "ray.io/v1" and re.fullmatch(r"\d+\.\d+\.\d+", cluster["spec"]["rayVersion"])
    groups = [cluster["spec"]["headGroupSpec"], *cluster["spec"]["workerGroupSpecs"]]
    images = {c["image"] for g in groups for c in g["template"]["spec"]["containers"]}
    assert len(images) == 1, "all nodes need the same versions"
    claims = {v["persistentVolumeClaim"]["claimName"] for g in groups for v in g["template"]["spec"]["volumes"]}
    assert claims == {claim["metadata"]["name"]}
    for group in cluster["spec"]["workerGroupSpecs"]:
        assert group["minReplicas"] <= group["replicas"] <= group["maxReplicas"]


def test_the_dockerfile_follows_the_rules():
    """Known instructions, a pinned base, no lists of packages left, no root, commands as lists."""
    found = instructions((FOLDER / "Dockerfile").read_text())
    assert {name for name, _ in found} <= INSTRUCTIONS and found[0][0] == "FROM"
    assert re.fullmatch(r"\S+:[\w.-]+", found[0][1]) and not found[0][1].endswith(":latest")
    for name, rest in found:
        if name == "RUN" and "apt-get install" in rest:
            assert (
                "apt-get update" in rest and "--no-install-recommends" in rest and "rm -rf /var/lib/apt/lists" in rest
            )
        if name == "RUN" and "pip install" in rest:
            assert "--no-cache-dir" in rest
        if name == "CMD":
            assert rest.startswith("[")
    assert [rest for name, rest in found if name == "USER"][-1] != "root"
    extras = re.search(r'"\.\[([\w,-]+)\]"', (FOLDER / "Dockerfile").read_text())
    assert extras is not None
    project = (FOLDER.parents[1] / "pyproject.toml").read_text()
    assert all(re.search(rf"^{extra} = \[", project, re.MULTILINE) for extra in extras[1].split(","))


@pytest.mark.slow
@pytest.mark.timeout(3600)
def test_the_dockerfile_builds():
    docker = shutil.which("docker")
    if docker is None or subprocess.run([docker, "info"], capture_output=True).returncode:
        pytest.skip("no Docker here")
    file, root = FOLDER / "Dockerfile", FOLDER.parents[1]
    done = subprocess.run([docker, "build", "-f", str(file), str(root)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-2000:]
