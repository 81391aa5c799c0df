#!/bin/sh
# Does what the README says, on a minimal Debian: mmdebstrap's minbase with python3 and python3-venv, nothing else.
#   tests/fresh/fresh.sh [SUITE:WHO …]     SUITE: bookworm or trixie; WHO: root, or user (no sudo). Default: all four
#   tests/fresh/fresh.sh --prepare              installs what makes bare systems, and nothing else
#   tests/fresh/fresh.sh --systems SUITE …      makes them in DRAGLAG_FRESH_CACHE, for later trials
# Needs root. DRAGLAG_FRESH_CACHE: a folder to keep the bare roots in. Exit 0: passed, 1: failed, 77: cannot be tried.
set -eu
cd "$(dirname "$0")/../.."
script=tests/fresh/fresh.sh
. tests/fresh/roots.sh

# Few, but some that start Qt's widgets.
TESTS="tests/core/curve/test_curve.py tests/app/windows/test_letter_menu.py"

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

case "${1:-}" in
--inside)
    trial "$2" "$3"
    exit 0
    ;;
--prepare)
    prepare
    exit 0
    ;;
--systems)
    shift
    : "${DRAGLAG_FRESH_CACHE:?names no folder to keep them in}"
    begin
    all_of bare_root "$@" || exit 77
    exit 0
    ;;
esac
[ $# -gt 0 ] || set -- bookworm:root bookworm:user trixie:root trixie:user
for name in "$@"; do
    case "$name" in bookworm:root | bookworm:user | trixie:root | trixie:user) ;; *)
        say "$name: no such case. Cases: bookworm:root bookworm:user trixie:root trixie:user"
        exit 2
        ;;
    esac
done
try_all "$@"
