"""Whoever attacks the helper for EtherCAT gets nothing run with its capabilities, nor as root (SECURITY.md)."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Iterator

import pytest

from draglag.messages import unpacked
from rights.namespace import World, why_not

_WHY_NOT = why_not()
pytestmark = pytest.mark.skipif(bool(_WHY_NOT), reason=f"no namespace with an installation: {_WHY_NOT}")
PYTHON = "/opt/draglag/bin/python"
HELPER = "/usr/local/lib/draglag/draglag-ethercat-master"
SITE = "$(echo /opt/draglag/lib/python3*/site-packages)"
EVIL = "echo run >>/tmp/evil-$$"  # what an attacker has run: it would leave a trace


@pytest.fixture(scope="module")
def module_world() -> Iterator[World]:
    try:
        made = World().__enter__()
    except RuntimeError as error:
        pytest.skip(str(error))
    yield made
    made.__exit__()


@pytest.fixture
def world(module_world: World) -> Iterator[World]:
    """The namespace, with an untouched installation and no trace of an attacker."""
    module_world.sh("rm -rf /home/user/* /opt/shared/* /usr/local/lib/draglag; cp -a /opt/draglag /opt/kept")
    yield module_world
    module_world.sh("rm -rf /opt/draglag; mv /opt/kept /opt/draglag; chmod 755 /usr/local/lib")


@pytest.fixture
def installed(world: World) -> World:
    assert world.install("eth77").returncode == 0
    return world


def refused(world: World, done: subprocess.CompletedProcess[str], *words: str) -> None:
    assert done.returncode == 1
    assert "Installed" not in done.stdout
    assert all(word in done.stderr for word in words), done.stderr
    assert world.sh(f"test -e {HELPER}").returncode != 0
    assert world.sh("test -e /home/user/evil").returncode != 0, "the attacker's code was run"


def evil(path: str) -> str:
    """A program of the attacker's in the place of a path; it leaves a trace."""
    return f"printf '#!/bin/sh\\ntouch /home/user/evil\\n' >{path}; chmod 755 {path}"


def test_a_member_can_use_what_was_installed_and_nobody_else_can(installed: World) -> None:
    done = installed.as_user(f"{HELPER} --check")
    assert (done.returncode, json.loads(done.stdout)) == (0, {"m": "complete"}), done.stderr
    stranger = installed.as_user(f"{HELPER} --check", member=False)
    assert stranger.returncode == 126
    assert installed.as_user(f"cp {HELPER} /home/user/copy").returncode == 0
    copied = installed.as_user("/home/user/copy --check")
    assert json.loads(copied.stdout)["code"] == "no_rights"  # a copy has no capabilities


def test_a_root_made_environment_in_a_user_s_folder_is_refused(world: World) -> None:
    world.sh("cp -a /opt/draglag /home/user/venv")
    assert world.sh("stat -c %u /home/user/venv/bin/python").stdout.strip() == "0"
    refused(world, world.install("/home/user/venv/bin/python", "eth77"), "/home/user can be changed by others")


def test_a_user_s_interpreter_is_not_even_run(world: World) -> None:
    world.as_user(evil("/home/user/python"))
    refused(world, world.install("/home/user/python", "eth77"), "/home/user can be changed")
    world.sh(f"{evil('/opt/shared/python')}; chown 1000 /opt/shared/python")
    refused(world, world.install("/opt/shared/python", "eth77"), "/opt/shared/python can be changed")


@pytest.mark.parametrize("chain", [
    "ln -s /home/user/way /opt/shared/way; ln -s /opt/draglag /home/user/way",  # a link of the user's on the way
    "mkdir /opt/shared/way; ln -s /home/user/../../opt/draglag/bin /opt/shared/way/bin",  # through the user's folder
    "mkdir -m 777 /opt/shared/open; ln -s /opt/draglag /opt/shared/open/way; ln -s open/way /opt/shared/way",
])  # fmt: skip
def test_a_way_through_what_others_can_rename_is_refused(world: World, chain: str) -> None:
    assert world.sh(chain).returncode == 0
    refused(world, world.install("/opt/shared/way/bin/python", "eth77"), "can be changed by others than root")


def test_a_medium_that_users_take_away_is_refused_whatever_it_says_of_its_owner(world: World) -> None:
    world.sh("mkdir /opt/shared/stick; mount -t tmpfs -o nosuid,mode=755 tmpfs /opt/shared/stick")
    try:
        world.sh("cp -a /opt/draglag /opt/shared/stick/venv; ln -s /opt /opt/shared/stick/way")
        for way in ("venv", "way/draglag"):
            done = world.install(f"/opt/shared/stick/{way}/bin/python", "eth77")
            refused(world, done, "/opt/shared/stick can be changed by others than root", "mounted nosuid")
    finally:
        world.sh("umount /opt/shared/stick")


def test_the_installers_follow_no_path_of_their_caller_s_environment(world: World) -> None:
    world.as_user("mkdir -p /home/user/bin /home/user/packaging/ethercat")
    for name in ("bin/dirname", "bin/find", "bin/findmnt", "bin/cc", "packaging/trusted.sh"):
        world.as_user(evil(f"/home/user/{name}"))
    for path in ("packaging/ethercat/install.sh eth77", "packaging/install.sh --none"):
        world.sh(f"PATH=/home/user/bin:$PATH CDPATH=/home/user TMPDIR=/home/user {path}")
        assert world.sh("test -e /home/user/evil").returncode != 0, "the attacker's code was run"
    assert world.sh(f"test -e {HELPER}").returncode == 0


def test_what_is_asked_of_an_interpreter_is_asked_without_the_group_s_rights(installed: World) -> None:
    """An interpreter that would run the attacker's code is refused, and until then has no use of the helper."""
    installed.sh("mkdir -m 777 /opt/shared/open")
    code = "import os; open('/opt/shared/open/ran', 'w').write(str([os.getuid(), os.getgid(), *os.getgroups()]))"
    installed.sh(f'echo "{code}" >{SITE}/more.pth; chown 1000 {SITE}/more.pth')
    done = installed.install("eth77")
    assert done.returncode == 1
    assert "more.pth can be changed by others than root" in done.stderr
    assert json.loads(installed.sh("cat /opt/shared/open/ran").stdout) == [65534, 65534]


@pytest.mark.parametrize("change", [
    f"echo /home/user/more >{SITE}/more.pth; mkdir /home/user/more",  # a folder of the user's among the modules'
    f"touch {SITE}/sitecustomize.py; chown 1000 {SITE}/sitecustomize.py",
    f"chmod g+w {SITE}/draglag_devices/rig.py",
    f"chmod o+w {SITE}",
    f"mv {SITE}/pysoem /home/user; ln -s /home/user/pysoem {SITE}/pysoem",
    "sed -i 's|^home = .*|home = /home/user|' /opt/draglag/pyvenv.cfg",
    "chown 1000 /opt/draglag/pyvenv.cfg",
    "chmod 775 /usr/local/lib",
])  # fmt: skip
def test_whatever_it_would_run_belongs_to_root_alone(world: World, change: str) -> None:
    assert world.sh(change).returncode == 0
    refused(world, world.install("eth77"), "can be changed by others than root")


def test_an_editable_checkout_is_refused_even_if_it_is_root_s(world: World) -> None:
    world.sh(
        f"mkdir /opt/shared/src; mv {SITE}/draglag_devices /opt/shared/src; echo /opt/shared/src >{SITE}/editable.pth"
    )
    refused(world, world.install("eth77"), "an editable installation", "sudo ./run install")


@pytest.mark.parametrize(
    "change", ["chmod 700 /opt/draglag", f"chmod 600 {SITE}/draglag_devices/ethercat_laser/wire.py"]
)
def test_what_members_cannot_execute_is_not_installed(world: World, change: str) -> None:
    assert world.sh(change).returncode == 0
    refused(world, world.install("eth77"), "members of the group draglag")


def test_a_missing_pysoem_is_said_before_anything_is_installed(world: World) -> None:
    world.sh(f"rm -r {SITE}/pysoem")
    refused(world, world.install("eth77"), "does not have pysoem")


@pytest.mark.parametrize("name", ["'eth0; reboot'", "../eth0", "-x", "averyverylonginterface", "'eth0\",\"eth1'"])
def test_an_interface_is_a_name_and_nothing_else(world: World, name: str) -> None:
    refused(world, world.install(name), "cannot be the name of a network interface")


def test_only_the_interfaces_of_the_installation_are_opened(installed: World) -> None:
    allowed = json.loads(installed.as_user(f"{HELPER} eth77 --channel 1 </dev/null").stdout.splitlines()[0])
    assert allowed["code"] == "no_interface"  # it was looked for
    other = installed.as_user(f"{HELPER} lo --channel 1 </dev/null")
    assert json.loads(other.stdout)["code"] == "not_allowed"
    assert "sudo ./run install lo" in json.loads(other.stdout, object_hook=unpacked)["remedy"]
    assert other.returncode == 1
    for hostile in ("eth77,lo", "eth7", "", "eth77 --only lo", "--only lo eth77", "--probe --only lo", "eth77 -c x"):
        assert installed.as_user(f"{HELPER} {hostile} </dev/null").returncode in (1, 2), hostile


def test_the_caller_s_environment_folder_and_modules_have_no_part_in_it(installed: World) -> None:
    script = """
        cd /home/user; mkdir -p draglag_devices bin
        for module in sitecustomize usercustomize json pysoem draglag_devices/__init__; do
            echo 'open("/home/user/evil", "w")' >$module.py
        done
        printf '#!/bin/sh\\ntouch /home/user/evil\\n' >bin/python3; cp bin/python3 bin/python; chmod 755 bin/*
        echo '#include <stdio.h>' >x.c
        echo '__attribute__((constructor)) static void x(void) { fopen("/home/user/evil", "w"); }' >>x.c
        cc -shared -fPIC -o x.so x.c
        PATH=/home/user/bin PYTHONPATH=/home/user PYTHONHOME=/home/user PYTHONSTARTUP=/home/user/json.py \\
        PYTHONINSPECT=1 PYTHONUSERBASE=/home/user PYTHONPLATLIBDIR=/home/user PYTHONEXECUTABLE=/home/user/bin/python \\
        LD_PRELOAD=/home/user/x.so LD_LIBRARY_PATH=/home/user LD_AUDIT=/home/user/x.so \\
        GCONV_PATH=/home/user HOME=/home/user \\
        """
    done = installed.as_user(f"{script} {HELPER} --check")
    assert json.loads(done.stdout) == {"m": "complete"}, done.stderr
    assert installed.sh("test -e /home/user/x.so").returncode == 0
    assert installed.sh("test -e /home/user/evil").returncode != 0


def test_a_running_helper_gives_its_caller_no_way_in(installed: World) -> None:
    installed.sh("touch /opt/shared/slow")
    with subprocess.Popen(
        installed.user_command(f"exec {HELPER} --check 9</etc/passwd"), stdout=subprocess.PIPE
    ) as helper:
        try:
            report = installed.sh(f"""
                while ! grep -qa ethercat_laser.master /proc/{helper.pid}/cmdline; do :; done
                grep CapEff /proc/{helper.pid}/status; ls /proc/{helper.pid}/fd""").stdout.split()
            assert report[:2] == ["CapEff:", "0000000000003000"]  # CAP_NET_ADMIN and CAP_NET_RAW, and no more
            assert "9" not in report[2:]
            attack = f"""
                import ctypes, os
                for name in ("mem", "fd/0", "fd/1", "environ", "maps", "cwd"):
                    place = "/proc/{helper.pid}/" + name
                    look = os.readlink if name == "cwd" else lambda place: open(place, "rb").read(1)
                    try:
                        look(place)
                        print("open", name)
                    except OSError:
                        pass
                if ctypes.CDLL(None).ptrace(16, {helper.pid}, 0, 0) == 0:
                    print("traced")
            """
            lines = "\n".join(line[16:] for line in attack.splitlines())
            attacked = installed.as_user(f"python3 -I -c '{lines.replace(chr(39), chr(34))}'")
            assert (attacked.returncode, attacked.stdout) == (0, ""), attacked.stderr
        finally:
            helper.kill()


@pytest.mark.parametrize("change", [
    "chown 1000 /opt/draglag",
    "chmod 777 /opt/draglag/bin",
    "mv /opt/draglag /home/user/; ln -s /home/user/draglag /opt/draglag",
    "mount -t tmpfs -o nosuid,mode=755 tmpfs /opt/draglag && cp -a /opt/kept/. /opt/draglag",
])  # fmt: skip
def test_an_installation_that_changed_hands_is_not_run(installed: World, change: str) -> None:
    assert installed.sh(change).returncode == 0
    done = installed.as_user(f"{HELPER} --check")
    assert done.returncode == 1
    assert "can be changed by others than root" in done.stderr
    installed.sh("umount /opt/draglag 2>/dev/null; chown -h 0:0 /opt/draglag")


def test_removing_takes_the_helper_away(installed: World) -> None:
    assert installed.install("--remove").returncode == 0
    assert installed.sh(f"test -e {HELPER}").returncode != 0
