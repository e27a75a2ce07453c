"""An experiment measured by jobs of Snakemake, here and on a cluster of one node by Slurm, is the experiment measured by one command.

  cluster_test.py PROGRAM [Locally|OnSlurm]        PROGRAM: the built amrtex

Controller and worker of Slurm are started here on the loopback device, without systemd, munge or cgroups, and stopped again. Tests whose package
is not installed (snakemake; slurmctld, slurmd and slurm-client of slurm-wlm) are skipped.
"""
import collections
import json
import os
import pathlib
import pwd
import shutil
import socket
import subprocess
import sys
import tempfile
import time
import unittest

ROOT = pathlib.Path(__file__).resolve().parent.parent
CLUSTER = ROOT / "experiments/cluster"
PROGRAM = str(pathlib.Path(sys.argv.pop(1)).resolve()) if len(sys.argv) > 1 else str(ROOT / "build/release/amrtex")

EXPERIMENT = {
    "name": "cluster",
    "datasets": [{"name": "it's \"tiny\"", "file": str(ROOT / "data/amrex_tiny/plt00008"), "field": "phi"}],
    "encodings": [{"name": "uniform"}, {"name": "page_table", "page_size": [4, 8]}],
    "filters": ["nearest"],
    "render": {"mode": "projection", "step": [1.0, 0.5], "width": 16, "height": 16},
    "views": [{"eye": [2.2, 1.8, 1.5], "at": [0.5, 0.5, 0.5], "up": [0, 0, 1], "fov_y": 35}],
    "frames": 2,
    "warm_up": 0,
}
POINTS = 6

SLURM_CONF = """ClusterName=amrtex
SlurmctldHost=localhost(127.0.0.1)
SlurmUser={user}
SlurmdUser={user}
AuthType=auth/none
CredType=cred/none
MpiDefault=none
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core_Memory
SlurmctldPort={ports[0]}
SlurmdPort={ports[1]}
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
SlurmdParameters=config_overrides
ReturnToService=2
NodeName=localhost NodeAddr=127.0.0.1 CPUs=2 RealMemory=16000 State=UNKNOWN
PartitionName=all Nodes=localhost Default=YES State=UP
"""


def records(folder):
    lines = (folder / "records.jsonl").read_text(encoding="utf-8").splitlines()
    return [json.loads(line)["record"] for line in lines]


def free_ports(count):
    sockets = [socket.socket() for _ in range(count)]
    for s in sockets:
        s.bind(("127.0.0.1", 0))
    ports = [s.getsockname()[1] for s in sockets]
    for s in sockets:
        s.close()
    return ports


class Workflow(unittest.TestCase):
    def setUp(self):
        if shutil.which("snakemake") is None:
            self.skipTest("no snakemake here: package snakemake")
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="amrtex cluster "))  # a path with a space
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)
        self.experiment = self.folder / "it's an experiment.json"
        self.write(EXPERIMENT)

    def write(self, experiment):
        self.experiment.write_text(json.dumps(experiment), encoding="utf-8")

    def snakemake(self, *arguments, environment=None, **config):
        config = {"experiment": str(self.experiment), "out": "out", "amrtex": PROGRAM, **config}
        words = [f"{key}={value}" for key, value in config.items()]
        return subprocess.run(["snakemake", "-s", str(CLUSTER / "Snakefile"), *arguments, "--config", *words], cwd=self.folder,
                              capture_output=True, text=True, timeout=300, env={**os.environ, **(environment or {})}, check=False)

    def run_whole(self, *arguments, environment=None, **config):
        done = self.snakemake(*arguments, environment=environment, **config)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        return done

    def jobs(self, place="here"):
        return sorted(path.parent for path in (self.folder / "out/jobs" / place).glob("*/done"))


class Locally(Workflow):
    def test_jobs_together_measure_every_point_once(self):
        self.run_whole("-j", "2")
        found = records(self.folder / "out/merged")
        self.assertEqual(len(self.jobs()), 3, "one for each structure")
        self.assertEqual(len(found), POINTS)
        self.assertEqual(len({r["configuration"] for r in found}), POINTS)
        self.assertEqual({r["status"] for r in found}, {"ok"})
        listed = subprocess.run([PROGRAM, "run", str(self.experiment), "--out", str(self.folder / "other"), "--list-points", "--json"],
                                capture_output=True, check=True)
        self.assertEqual({p["configuration"] for p in json.loads(listed.stdout)}, {r["configuration"] for r in found})
        for record in found:
            self.assertTrue(list((self.folder / "out/merged/pictures").glob(record["configuration"] + "*.png")))
        self.assertIn("Nothing to be done", self.run_whole("-j", "1").stderr, "a second call measures nothing")

    def test_contexts_stay_apart(self):
        self.run_whole("-j", "1", points_per_job=4)
        self.assertEqual(sorted(len(records(job)) for job in self.jobs()), [2, 4], "whole structures, until there are enough points")
        # a rasteriser of half the width is another renderer
        self.run_whole("-j", "1", environment={"LP_NATIVE_VECTOR_WIDTH": "128"}, points_per_job=POINTS, place="narrow")
        found = records(self.folder / "out/merged")
        renderers = collections.Counter(r["context"]["renderer"] for r in found)
        if len(renderers) == 1:
            self.skipTest(f"no second GL context here: {renderers} heeds no LP_NATIVE_VECTOR_WIDTH")
        self.assertEqual(sorted(renderers.values()), [POINTS, POINTS])
        self.assertEqual(len({r["configuration"] for r in found}), POINTS)

    def test_failed_points_are_records_and_no_failure_of_the_workflow(self):
        self.write({**EXPERIMENT, "check": {"psnr_db": 300, "why": "what no float reaches"}})
        self.run_whole("-j", "1", points_per_job=POINTS)
        self.assertEqual(collections.Counter(r["status"] for r in records(self.folder / "out/merged")), {"failed": POINTS})

    def test_a_wrong_key_stops_it_with_the_programs_own_words(self):
        self.write({**EXPERIMENT, "framse": 2})
        done = self.snakemake("-j", "1")
        self.assertNotEqual(done.returncode, 0)
        self.assertIn("framse", done.stderr)
        self.assertFalse((self.folder / "out/merged/here.done").exists())


class OnSlurm(Workflow):
    def setUp(self):
        super().setUp()
        paths = os.environ.get("PATH", "") + ":/usr/sbin:/sbin"
        for program in ("slurmctld", "slurmd", "sbatch", "scontrol"):
            if shutil.which(program, path=paths) is None:
                self.skipTest(f"no {program} here: package slurm-wlm")
        self.slurm = pathlib.Path(tempfile.mkdtemp(prefix="amrtex_slurm"))
        self.addCleanup(shutil.rmtree, self.slurm, ignore_errors=True)
        for folder in ("state", "spool"):
            (self.slurm / folder).mkdir()
        conf = self.slurm / "slurm.conf"
        conf.write_text(SLURM_CONF.format(user=pwd.getpwuid(os.getuid()).pw_name, ports=free_ports(2), folder=self.slurm), encoding="utf-8")
        self.environment = {"SLURM_CONF": str(conf), "PATH": paths}
        self.start("slurmctld", "-D")
        self.start("slurmd", "-D", "-N", "localhost")
        self.wait_for_node()

    def start(self, *command):
        log = open(self.slurm / f"{command[0]}.log", "wb")  # closed with the process
        process = subprocess.Popen(command, stdout=log, stderr=subprocess.STDOUT, env={**os.environ, **self.environment})
        log.close()
        self.addCleanup(self.stop, process)

    @staticmethod
    def stop(process):
        process.terminate()
        try:
            process.wait(20)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()

    def wait_for_node(self):
        for _ in range(60):
            shown = subprocess.run(["sinfo", "--noheader", "--format=%T"], capture_output=True, text=True, check=False,
                                   env={**os.environ, **self.environment})
            if shown.stdout.strip() == "idle":
                return
            time.sleep(0.5)
        logs = "".join(log.read_text(errors="replace")[-2000:] for log in self.slurm.glob("*.log"))
        self.fail(f"Slurm did not come up: {shown.stdout}{shown.stderr}\n{logs}")

    def test_jobs_of_slurm_measure_every_point_once(self):
        self.run_whole("--profile", str(CLUSTER / "slurm"), "--latency-wait", "5", environment=self.environment, points_per_job=4)
        found = records(self.folder / "out/merged")
        self.assertEqual(len({r["configuration"] for r in found}), POINTS)
        self.assertEqual({r["status"] for r in found}, {"ok"})
        ran = subprocess.run(["scontrol", "--oneliner", "show", "jobs"], capture_output=True, text=True, check=True,
                             env={**os.environ, **self.environment}).stdout.splitlines()
        self.assertEqual(len([line for line in ran if "JobState=COMPLETED" in line and "JobName=amrtex-measure" in line]), 2)

    def test_a_job_that_was_cancelled_is_begun_again(self):
        status = CLUSTER / "slurm/status.py"
        environment = {**os.environ, **self.environment}
        job = subprocess.run(["sbatch", "--parsable", "--hold", "--output=/dev/null", "--wrap=true"], capture_output=True, text=True,
                             check=True, env=environment).stdout.strip()
        asked = lambda id: subprocess.run([status, id], capture_output=True, text=True, check=True, env=environment).stdout.strip()
        self.assertEqual(asked(job), "running", "a job that waits is not over")
        subprocess.run(["scancel", job], check=True, env=environment)
        self.assertEqual(asked(job), "failed")
        self.assertEqual(asked(f"{job};cluster"), "failed", "as sbatch writes it where there are several clusters")
        self.assertEqual(asked("4711"), "failed", "nobody knows it any more")


if __name__ == "__main__":
    result = unittest.main(verbosity=2, exit=False).result
    if result.wasSuccessful() and result.testsRun == len(result.skipped):
        sys.exit(77)  # skipped, for ctest
    sys.exit(not result.wasSuccessful())
