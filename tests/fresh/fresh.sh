#!/bin/sh
# Does what the README says, on a minimal Debian: debootstrap's minbase with python3 and python3-venv, nothing else.
#   tests/fresh/fresh.sh [SUITE:WHO …]     SUITE: bookworm or trixie; WHO: root, or user (no sudo). Default: all four
# Needs root. DRAGLAG_FRESH_CACHE: a folder to keep the bare roots in. Exit 0: passed, 1: failed, 77: cannot be tried.
set -eu
cd "$(dirname "$0")/../.."

# Few, but some that start Qt's widgets.
TESTS="tests/core/test_curve.py tests/app/windows/test_letter_menu.py"

say() { printf '%s\n' "$*" >&2; }
cannot() { say "Not tried: $*"; exit 77; }
wrong() { say "Wrong: $*"; exit 1; }

# --- In the case's own namespace, where every mount ends with it ------------------------------------------------------

mounts() { # mounts: /proc and the like, and what pip's settings name
    mount -t proc proc "$root/proc"
    mount -t tmpfs tmpfs "$root/dev/shm"
    while read -r path; do
        [ -d "$path" ] && mkdir -p "$root$path"
        [ -f "$path" ] && mkdir -p "$root${path%/*}" && : >>"$root$path"
        mount --bind "$path" "$root$path"
        mount -o remount,bind,ro "$root$path"
    done <"$root/.binds"
}

as() { # as ACCOUNT COMMAND: in the root, with hardly any environment
    account=$1 home=/root path=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin
    [ "$account" = root ] || { home=/home/newcomer path=/usr/local/bin:/usr/bin:/bin; }
    ids=0:0
    [ "$account" = root ] || ids=1000:1000
    shift
    say "[$account, after $(($(date +%s) - begun)) s] $*"
    # shellcheck disable=SC2046 # a word for each variable
    chroot --userspec=$ids --groups= "$root" env -i HOME=$home PATH=$path \
        $(env | grep -iE '^(https?|no|all)_proxy=' || true) sh -c "cd $checkout && $*" </dev/null 2>&1
}

trial() { # trial ROOT WHO: the README's commands
    root=$1 who=$2 begun=$(date +%s)
    checkout=/root/draglag
    [ "$who" = root ] || checkout=/home/newcomer/draglag
    mounts
    out=$(as "$who" ./run --yes demo --no-window) || { say "$out"; wrong "./run demo failed"; }
    say "$out"
    for file in session.h5 report.html; do
        [ -s "$root$checkout/draglag-demo/$file" ] || wrong "./run demo left no $file"
    done
    [ "$who" = root ] || without_rights
    as "$who" ./run --yes test "$TESTS" || wrong "./run test failed"
    out=$(as "$who" ./run draglag verify draglag-demo/session.h5) || { say "$out"; wrong "./run draglag failed"; }
    case "$out" in *nstall*) say "$out"; wrong "everything is there, but run installs or asks again" ;; esac
}

without_rights() { # without_rights: tests say in one line that Qt's libraries are missing; the printed line brings them
    if out=$(as "$who" ./run --yes test "$TESTS"); then say "$out"; wrong "./run test passed without Qt's libraries"; fi
    say "$out"
    case "$out" in
    *Traceback* | *Error*) wrong "./run test shows a traceback where Qt's libraries are missing" ;;
    *"Qt, which the tests need, does not find lib"*) ;;
    *) wrong "./run test does not say which library is missing" ;;
    esac
    line=$(printf '%s\n' "$out" | sed -n 's/^ *sudo \(apt-get install .*\)/\1/p')
    [ -n "$line" ] || wrong "./run test does not say what to install"
    as root "apt-get update && DEBIAN_FRONTEND=noninteractive $line" >"$root/.apt" || {
        tail -n 5 "$root/.apt"
        wrong "$line"
    }
}

# --- Outside ----------------------------------------------------------------------------------------------------------

mirror() { # mirror: the Debian mirror of this machine's apt, however its sources are written; nothing if there is none
    grep -qx 'ID=debian' /etc/os-release || return 0
    apt-get indextargets --format '$(REPO_URI)' 'Created-By: Packages' 2>/dev/null | grep -v security | head -n 1
}

prepare() { # prepare: what debootstrap and the namespaces need
    [ "$(id -u)" -eq 0 ] || cannot "making a root system needs root. Run: sudo ./run fresh"
    unshare --mount --pid --fork true 2>/dev/null || cannot "this machine allows no namespaces of one's own"
    command -v debootstrap >/dev/null 2>&1 || {
        apt-get update && apt-get install -y --no-install-recommends debootstrap
    } >/dev/null 2>&1 || cannot "debootstrap is missing. Run: apt-get install -y debootstrap"
}

bare_root() { # bare_root SUITE: makes it in the cache, if it is not there
    [ -f "$cache/$1/.made" ] && return 0
    begun=$(date +%s)
    rm -rf "${cache:?}/$1"
    mkdir -p "$cache/$1"
    # shellcheck disable=SC2046 # no word where there is no mirror: then debootstrap's own
    debootstrap --variant=minbase --include=python3,python3-venv "$1" "$cache/$1" $(mirror) >"$work/$1.log" 2>&1 || {
        tail -n 5 "$work/$1.log" >&2
        cannot "debootstrap could not make $1. Check the network"
    }
    rm -rf "$cache/$1"/var/cache/apt/archives/*.deb
    : >"$cache/$1/.made"
    say "$1: root system made in $(($(date +%s) - begun)) s"
}

fill_root() { # fill_root SUITE WHO ROOT: a copy of the bare one, with a clean clone and this machine's ways to packages
    cp -a "$cache/$1" "$3"
    cp -L /etc/resolv.conf "$3/etc/resolv.conf"
    apt-config dump | grep -E '^Acquire::(http|https)::' >"$3/etc/apt/apt.conf.d/99host" || true
    python=${DRAGLAG_VENV:-.venv}/bin/python
    [ -x "$python" ] || python=python3
    "$python" tests/fresh/pip_settings.py "$3/etc/pip.conf" >"$3/.binds"
    home=$3/root
    [ "$2" = root ] || { chroot "$3" useradd --create-home --uid 1000 newcomer; home=$3/home/newcomer; }
    git clone --quiet --no-hardlinks . "$home/draglag"
    [ "$2" = root ] || chown -R 1000:1000 "$home/draglag"
}

one_case() { # one_case SUITE:WHO
    begun=$(date +%s)
    fill_root "${1%%:*}" "${1##*:}" "$work/$1"
    unshare --mount --pid --fork --kill-child --propagation private \
        sh tests/fresh/fresh.sh --inside "$work/$1" "${1##*:}" >"$work/$1.log" 2>&1 &
    inner=$!
    trap 'kill "$inner" 2>/dev/null; exit 1' INT TERM HUP
    word=passed
    wait "$inner" || { word=failed; tail -n 40 "$work/$1.log" >&2; }
    [ $word = failed ] || grep '^\[' "$work/$1.log" | sed "s/^/$1 /" >&2
    rm -rf "$work/$1"
    say "$1 $word in $(($(date +%s) - begun)) s"
    [ "$word" = passed ]
}

all_of() { # all_of FUNCTION WORD …: the function for each word, all at once; fails if one does
    function=$1 children=
    shift
    for name in "$@"; do
        "$function" "$name" &
        children="$children $!"
    done
    bad=0
    for child in $children; do wait "$child" || bad=1; done
    children=
    return "$bad"
}

clean() { # clean: also after Ctrl-C; the mounts end with the namespaces, those with their first process
    # shellcheck disable=SC2086 # several
    [ -z "$children" ] || kill $children 2>/dev/null || true
    wait
    rm -rf "${work:?}"
}

if [ "${1:-}" = --inside ]; then
    trial "$2" "$3"
    exit 0
fi
[ $# -gt 0 ] || set -- bookworm:root bookworm:user trixie:root trixie:user
for name in "$@"; do
    case "$name" in bookworm:root | bookworm:user | trixie:root | trixie:user) ;; *)
        say "$name: no such case. Cases: bookworm:root bookworm:user trixie:root trixie:user"
        exit 2
        ;;
    esac
done
prepare
work=$(mktemp -d)
cache=${DRAGLAG_FRESH_CACHE:-$work/bare}
children=
trap clean EXIT
trap 'exit 1' INT TERM HUP
# shellcheck disable=SC2046 # a word for each suite
all_of bare_root $(printf '%s\n' "$@" | sed 's/:.*//' | sort -u) || exit 77
failed=0
while [ $# -gt 0 ]; do # two at once
    if [ $# -gt 1 ]; then
        all_of one_case "$1" "$2" || failed=1
        shift
    else
        all_of one_case "$1" || failed=1
    fi
    shift
done
exit "$failed"
