"""A Slurm of one node on this machine, with its own key, sockets, ports and state, for as long as a test lasts."""

import contextlib
import os
import shutil
import socket
import subprocess
import time
from pathlib import Path

PROGRAMS = ("munged", "munge", "slurmctld", "slurmd", "sbatch", "srun", "squeue", "sinfo", "scancel")
CONF = """\
ClusterName=private
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={ports[0]}
SlurmdPort={ports[1]}
SlurmUser=root
AuthType=auth/munge
AuthInfo=socket={here}/munge.socket
CredType=cred/munge
StateSaveLocation={here}/state
SlurmdSpoolDir={here}/spool
SlurmctldPidFile={here}/slurmctld.pid
SlurmdPidFile={here}/slurmd.pid
SlurmctldLogFile={here}/slurmctld.log
SlurmdLogFile={here}/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SwitchType=switch/none
MpiDefault=none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
AccountingStorageType=accounting_storage/none
JobAcctGatherType=jobacct_gather/none
ReturnToService=2
MinJobAge=600
SchedulerParameters=batch_sched_delay=1,sched_interval=5
NodeName={host} NodeAddr=127.0.0.1 CPUs={cpus} RealMemory={memory_mb} State=UNKNOWN
PartitionName=all Nodes={host} Default=YES MaxTime=INFINITE State=UP
"""


def missing():
    """Programs that are not installed (Debian: slurm-wlm, munge)."""
    return [name for name in PROGRAMS if shutil.which(name) is None]


@contextlib.contextmanager
def private_slurm(here: Path, cpus: int):
    """Yields the environment in which sbatch and srun speak to it."""
    host = socket.gethostname().split(".")[0]
    for name in ("state", "spool", "bin"):
        (here / name).mkdir(parents=True)
    (here / "munge.key").write_bytes(os.urandom(1024))
    (here / "munge.key").chmod(0o400)
    memory_mb = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") // 2**20 * 3 // 4
    conf = here / "slurm.conf"
    conf.write_text(CONF.format(host=host, here=here, cpus=cpus, memory_mb=memory_mb, ports=_free_ports(2)))
    # Snakemake's job step starts srun without SLURM_CONF.
    wrapper = here / "bin" / "srun"
    wrapper.write_text(f'#!/bin/sh\nSLURM_CONF={conf} exec {shutil.which("srun")} "$@"\n')
    wrapper.chmod(0o755)
    environment = os.environ | {"SLURM_CONF": str(conf), "PATH": f"{here / 'bin'}:{os.environ['PATH']}"}
    with contextlib.ExitStack() as stack:
        def start(name, *arguments):
            out = stack.enter_context(open(here / f"{name}.out", "wb"))
            process = subprocess.Popen([shutil.which(name), *arguments], stdout=out, stderr=out, env=environment,
                                       stdin=subprocess.DEVNULL)
            stack.callback(_end, process)

        def wait(command, word):
            deadline = time.monotonic() + 60
            while True:
                done = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
                if done.returncode == 0 and word in done.stdout:
                    return
                assert time.monotonic() < deadline, (command, done.stdout, done.stderr)
                time.sleep(0.2)

        start("munged", "--force", "-F", f"--key-file={here}/munge.key", f"--socket={here}/munge.socket",
              f"--pid-file={here}/munge.pid", f"--log-file={here}/munge.log", f"--seed-file={here}/munge.seed")
        wait(["munge", "-n", f"--socket={here}/munge.socket"], "MUNGE")
        start("slurmctld", "-D", "-f", str(conf))
        start("slurmd", "-D", "-f", str(conf), "-N", host)
        wait(["sinfo", "-h", "-o", "%T"], "idle")
        try:
            yield environment
        finally:
            subprocess.run(["scancel", "--user=root"], env=environment, capture_output=True, check=False)
            deadline = time.monotonic() + 30
            while time.monotonic() < deadline and subprocess.run(
                    ["squeue", "-h"], env=environment, capture_output=True, check=False).stdout.strip():
                time.sleep(0.5)


def _free_ports(count):
    with contextlib.ExitStack() as stack:
        sockets = [stack.enter_context(socket.socket()) for _ in range(count)]
        for each in sockets:
            each.bind(("127.0.0.1", 0))
        return [each.getsockname()[1] for each in sockets]


def _end(process):
    process.terminate()
    try:
        process.wait(20)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
