# Sourced by what is tried on a minimal Debian (mmdebstrap's minbase with python3 and python3-venv, nothing else). The
# script that sources it stands in the checkout's root, names itself in $script, and has a function `trial ROOT WHO`,
# which is run in a namespace of its own, in a copy of the bare root that holds a clean clone. POSIX sh.

say() { printf '%s\n' "$*" >&2; }
cannot() { say "Not tried: $*"; exit 77; }
wrong() { say "Wrong: $*"; exit 1; }

# --- In the case's own namespace, where every mount ends with it ------------------------------------------------------

mounts() { # mounts: /proc and the like, and what pip's settings name
    mount --bind "$root" "$root" # so that / is a mounted file system in it, too
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

# --- Outside ----------------------------------------------------------------------------------------------------------

mirror() { # mirror: the Debian mirror of this machine's apt, however its sources are written; nothing if there is none
    grep -qx 'ID=debian' /etc/os-release || return 0
    apt-get indextargets --format '$(REPO_URI)' 'Created-By: Packages' 2>/dev/null | grep -v security | head -n 1
}

prepare() { # prepare: what mmdebstrap and the namespaces need
    [ "$(id -u)" -eq 0 ] || cannot "making a root system needs root. Run: sudo ./run fresh"
    unshare --mount --pid --fork true 2>/dev/null || cannot "this machine allows no namespaces of one's own"
    command -v mmdebstrap >/dev/null 2>&1 || {
        apt-get update && apt-get install -y --no-install-recommends mmdebstrap
    } >/dev/null 2>&1 || cannot "mmdebstrap is missing. Run: apt-get install -y mmdebstrap"
}

bare_root() { # bare_root SUITE: makes it in the cache, if it is not there
    [ -f "$cache/$1/.made" ] && return 0
    begun=$(date +%s)
    rm -rf "${cache:?}/$1"
    mkdir -p "$cache/$1"
    # /bin is a link into /usr, as an installed Debian has it. debootstrap takes twice the processor time for the same.
    # shellcheck disable=SC2046 # no word where there is no mirror: then mmdebstrap's own
    mmdebstrap --mode=root --variant=minbase --include=python3,python3-venv \
        --hook-dir=/usr/share/mmdebstrap/hooks/maybe-merged-usr \
        "$1" "$cache/$1" $(mirror) >"$work/$1.log" 2>&1 || {
        tail -n 5 "$work/$1.log" >&2
        cannot "mmdebstrap could not make $1. Check the network"
    }
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
        sh "$script" --inside "$work/$1" "${1##*:}" >"$work/$1.log" 2>&1 &
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

begin() { # begin: what trials, and the making of roots, need and leave nothing of
    prepare
    work=$(mktemp -d)
    cache=${DRAGLAG_FRESH_CACHE:-$work/bare}
    children=
    trap clean EXIT
    trap 'exit 1' INT TERM HUP
}

try_all() { # try_all SUITE:WHO …: exit 0 when all passed
    begin
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
}
