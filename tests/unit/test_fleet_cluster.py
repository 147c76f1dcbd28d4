"""Fleets on a cluster: the same catalogue, whatever is killed; and logs from a store of objects."""

from __future__ import annotations

import datetime
import ipaddress
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

from flightid.errors import DataError, OptionError
from flightid.fleet import fleet_status, run_fleet
from flightid.fleet.catalogue.store import store_at
from flightid.fleet.engine.claims import LogClaims, can_claim
from flightid.fleet.opening import open_catalogue

pytest.importorskip("distributed")
pytest.importorskip("duckdb")
psutil = pytest.importorskip("psutil")

EXAMPLE = Path(__file__).parents[2] / "examples" / "fleet"
CLEAN = {"PYTHONPATH": os.pathsep.join(sys.path)}


def fleet_of(folder: Path, n_logs: int) -> Path:
    """The example over logs that are refused at once: what is tested is who takes them."""
    for name in ("fleet.toml", "study.toml"):
        shutil.copy(EXAMPLE / name, folder)
    (folder / "logs").mkdir()
    for number in range(n_logs):
        (folder / "logs" / f"V{number:02d}-20260301.bin").write_bytes(b"no log %d" % number)
    return folder / "fleet.toml"


def dask(*arguments: str, **surroundings: str) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-m", "distributed.cli.dask_scheduler"]
    if arguments[0] == "worker":
        command = [sys.executable, "-m", "distributed.cli.dask_worker", *arguments[1:]]
    else:
        command += arguments[1:]
    return subprocess.Popen(
        command, stderr=subprocess.DEVNULL, env=os.environ | CLEAN | surroundings
    )


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[tuple[str, list[subprocess.Popen[bytes]]]]:
    """A scheduler and a worker, processes of their own; the address, and both of them."""
    file = tmp_path / "scheduler.json"
    options = ("--scheduler-file", str(file))
    processes = [dask("scheduler", *options, "--no-dashboard", "--host", "127.0.0.1")]
    worker = ("worker", *options, "--nthreads", "1", "--no-dashboard", "--death-timeout", "60")
    processes.append(dask(*worker))
    deadline = time.monotonic() + 60
    while not file.exists():
        assert time.monotonic() < deadline
        time.sleep(0.1)
    yield json.loads(file.read_text())["address"], processes
    for process in processes:
        process.terminate()
    for process in processes:
        process.wait(timeout=30)


@pytest.mark.nightly
def test_a_scheduler_that_exists_is_used_and_its_death_is_told(
    cluster: tuple[str, list[subprocess.Popen[bytes]]], tmp_path: Path
) -> None:
    address, (scheduler, _) = cluster
    folder = tmp_path / "first"
    folder.mkdir()
    fleet = fleet_of(folder, 6)
    done = run_fleet(fleet, scheduler=address)
    assert done.outcomes == {"refused": 6}
    assert run_fleet(fleet, scheduler=address).kept == 6
    scheduler.send_signal(signal.SIGKILL)
    scheduler.wait()
    (folder / "logs" / "V99-20260301.bin").write_bytes(b"another")
    with pytest.raises((DataError, OptionError)):
        run_fleet(fleet, scheduler=address)
    assert run_fleet(fleet, workers=1).outcomes == {"refused": 1}


def certificates(folder: Path) -> dict[str, str]:
    """An authority and a certificate for this machine, as Dask's configuration names them."""
    x509 = pytest.importorskip("cryptography.x509")
    primitives = "cryptography.hazmat.primitives"
    hashes, serialization, ec = (
        import_module(f"{primitives}.{name}")
        for name in ("hashes", "serialization", "asymmetric.ec")
    )

    def made(name: str, issuer: tuple[Any, Any] | None) -> tuple[Any, Any]:
        key = ec.generate_private_key(ec.SECP256R1())
        own = x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, name)])
        by, signed_by = (own, key) if issuer is None else (issuer[0].subject, issuer[1])
        now = datetime.datetime.now(datetime.UTC)
        builder = x509.CertificateBuilder(
            by, own, key.public_key(), x509.random_serial_number(),
            now - datetime.timedelta(days=1), now + datetime.timedelta(days=1),
        )  # fmt: skip
        basic = x509.BasicConstraints(ca=issuer is None, path_length=None)
        hosts = x509.SubjectAlternativeName([x509.IPAddress(ipaddress.ip_address("127.0.0.1"))])
        builder = builder.add_extension(basic, critical=True).add_extension(hosts, critical=False)
        return builder.sign(signed_by, hashes.SHA256()), key

    authority = made("authority", None)
    host, key = made("127.0.0.1", authority)
    pem = serialization.Encoding.PEM
    plain = (serialization.PrivateFormat.PKCS8, serialization.NoEncryption())
    (folder / "ca.pem").write_bytes(authority[0].public_bytes(pem))
    (folder / "host.pem").write_bytes(host.public_bytes(pem))
    (folder / "host.key").write_bytes(key.private_bytes(pem, *plain))
    names = {"ca-file": "ca.pem"}
    for role in ("scheduler", "worker", "client"):
        names |= {f"{role}.cert": "host.pem", f"{role}.key": "host.key"}
    return {key: str(folder / name) for key, name in names.items()}


@pytest.mark.nightly
def test_a_tls_scheduler_takes_logs_of_whoever_has_a_certificate_alone(tmp_path: Path) -> None:
    config = pytest.importorskip("dask.config")
    told = {f"distributed.comm.tls.{key}": name for key, name in certificates(tmp_path).items()}
    marks = {".": "__", "-": "_"}
    named = {
        "DASK_" + "".join(marks.get(letter, letter) for letter in key).upper(): name
        for key, name in told.items()
    }
    file = tmp_path / "scheduler.json"
    options = ("--scheduler-file", str(file))
    host = ("--no-dashboard", "--protocol", "tls", "--host", "127.0.0.1")
    worker = ("worker", *options, "--nthreads", "1", "--no-dashboard", "--death-timeout", "60")
    processes = [dask("scheduler", *options, *host, **named), dask(*worker, **named)]
    try:
        deadline = time.monotonic() + 60
        while not file.exists():
            assert time.monotonic() < deadline
            time.sleep(0.1)
        address = json.loads(file.read_text())["address"]
        assert address.startswith("tls://127.0.0.1:")
        (tmp_path / "fleet").mkdir()
        fleet = fleet_of(tmp_path / "fleet", 4)
        with pytest.raises(OptionError, match="no certificate for the scheduler"):
            run_fleet(fleet, scheduler=address)
        with config.set(told):
            done = run_fleet(fleet, scheduler=address)
        assert done.outcomes == {"refused": 4}
        assert [each.code for each in done.findings] == ["nothing-fitted"]
    finally:
        for process in processes:
            process.terminate()
        for process in processes:
            process.wait(timeout=30)


@pytest.mark.nightly
def test_killed_clients_and_workers_lose_only_logs_in_flight(tmp_path: Path) -> None:
    """Client, nanny or worker, and log process ended with -9: the next run takes the rest."""
    fleet = fleet_of(tmp_path, 40)
    for victim in ("client", "worker", "process"):
        client = subprocess.Popen(
            [sys.executable, "-m", "flightid", "fleet", "run", str(fleet), "--workers", "2"],
            env=os.environ | CLEAN,
            stderr=subprocess.DEVNULL,
        )
        before = _taken(fleet)
        while _taken(fleet) < before + 4 and client.poll() is None:
            time.sleep(0.05)
        for pid in [client.pid] if victim == "client" else _below(client.pid, victim):
            try:
                os.kill(pid, signal.SIGKILL)
            except ProcessLookupError:
                continue
            if victim != "client":
                break
        client.wait(timeout=300)
        if victim != "client":
            assert client.returncode == 1  # none is a log
        # A fresh set of logs for the next victim.
        for path in list((tmp_path / "logs").iterdir()):
            path.write_bytes(path.read_bytes() + victim.encode())
    final = run_fleet(fleet, workers=2)
    assert final.outcomes == {"refused": 40}
    with open_catalogue(fleet) as catalogue:
        ((n, distinct),) = catalogue.query(
            "SELECT count(*), count(DISTINCT log) FROM logs"
        ).fetchall()
        assert n == distinct
        ((present,),) = catalogue.query(
            "SELECT count(*) FROM logs WHERE outcome = 'failed'"
        ).fetchall()
        assert present == 0
    assert fleet_status(fleet).quarantine == ()


def _taken(fleet: Path) -> int:
    try:
        return fleet_status(fleet).n_logs
    except DataError:
        return 0


def _below(pid: int, kind: str) -> list[int]:
    """Workers of a client (processes of Dask), or the processes in which logs are taken."""
    below = psutil.Process(pid).children(recursive=True)
    is_log = {each.pid: "fleet.engine.child" in " ".join(each.cmdline()) for each in below}
    if kind == "process":
        return [number for number, yes in is_log.items() if yes]
    parents = {each.ppid() for each in below if is_log[each.pid]}
    return [number for number in parents if number != pid]


@pytest.mark.nightly
def test_two_clients_on_one_catalogue_lose_no_log_and_count_none_twice(tmp_path: Path) -> None:
    fleet = fleet_of(tmp_path, 24)
    path = fleet.read_text().replace("time_s = 300", "time_s = 300\ncompact_every = 5")
    fleet.write_text(path)
    command = [sys.executable, "-m", "flightid", "fleet", "run", str(fleet), "--workers", "1"]
    clients = [
        subprocess.Popen(command, env=os.environ | CLEAN, stdout=subprocess.PIPE) for _ in range(2)
    ]
    said = [client.communicate(timeout=300)[0].decode() for client in clients]
    assert [client.returncode for client in clients] == [1, 1], said  # none is a log
    with open_catalogue(fleet) as catalogue:
        found = catalogue.query(
            "SELECT count(*), count(DISTINCT log), count_if(outcome = 'refused') FROM logs"
        ).fetchall()
    assert found == [(24, 24, 24)]
    assert fleet_status(fleet).quarantine == ()
    assert run_fleet(fleet, workers=1).kept == 24


@pytest.mark.nightly
def test_logs_and_catalogue_may_lie_in_a_store_of_objects(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    s3fs = pytest.importorskip("s3fs")
    server = pytest.importorskip("moto.server")
    running = server.ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    running.start()
    try:
        host, port = running.get_host_and_port()
        for name, value in {
            "AWS_ENDPOINT_URL": f"http://{host}:{port}",
            "AWS_ACCESS_KEY_ID": "testing",
            "AWS_SECRET_ACCESS_KEY": "testing",
            "AWS_DEFAULT_REGION": "us-east-1",
        }.items():
            monkeypatch.setenv(name, value)
        s3fs.S3FileSystem.clear_instance_cache()
        files = s3fs.S3FileSystem()
        files.mkdir("fleet")
        fleet = fleet_of(tmp_path, 3)
        for path in (tmp_path / "logs").iterdir():
            files.pipe_file(f"fleet/2026/{path.name}", path.read_bytes())
        text = fleet.read_text().replace('logs = ["logs"]', 'logs = ["s3://fleet/2026/"]')
        fleet.write_text(text.replace("study =", 'catalogue = "s3://fleet/catalogue"\nstudy ='))
        assert run_fleet(fleet, workers=1).outcomes == {"refused": 3}
        assert run_fleet(fleet, workers=1).kept == 3
        assert fleet_status(fleet).outcomes == {"refused": 3}
        with open_catalogue(fleet) as catalogue:
            found = catalogue.query("SELECT vehicle, flown_at_from FROM logs ORDER BY 1").fetchall()
        assert found == [("V00", "name"), ("V01", "name"), ("V02", "name")]
        store = store_at("s3://fleet/catalogue")
        assert can_claim(store)
        with ThreadPoolExecutor(4) as runs:
            claims = [LogClaims(store, f"run{number}") for number in range(4)]
            won = runs.map(lambda each: [each.take(f"log{k}") for k in range(10)], claims)
        assert [sum(each) for each in zip(*won, strict=True)] == [1] * 10
    finally:
        running.stop()
