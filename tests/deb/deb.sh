#!/bin/sh
# Builds the Debian package on a minimal Debian, installs it on a clean one with apt, uses it as a user, and removes it.
#   tests/deb/deb.sh [SUITE …]     SUITE: bookworm or trixie. Default: both
# Needs root. DRAGLAG_FRESH_CACHE: a folder to keep the bare roots in; DRAGLAG_DEB_KEEP: one to keep the packages in.
# Exit 0: passed, 1: failed, 77: cannot be tried.
set -eu
cd "$(dirname "$0")/../.."
script=tests/deb/deb.sh
. tests/fresh/roots.sh

HDF=/home/newcomer/other.h5 # an HDF5 file of another program
HELPER=/usr/lib/draglag/draglag-ethercat-master
APT="DEBIAN_FRONTEND=noninteractive apt-get -y -q --no-install-recommends"

trial() { # trial ROOT WHO: built in one root, used in another
    root=$1 who=$2 begun=$(date +%s) checkout=/root/draglag
    used=$root.used
    cp -a "$root" "$used"
    rm -rf "$used/root/draglag"
    mounts
    check_parts
    quietly ./run --yes deb
    package=$(cd "$root$checkout/dist" && echo draglag_*.deb)
    [ -s "$root$checkout/dist/$package" ] || wrong "./run deb left no package"
    [ -z "${DRAGLAG_DEB_KEEP:-}" ] || cp "$root$checkout/dist/$package" "$DRAGLAG_DEB_KEEP"
    check_owners

    built=$root$checkout/dist/$package
    root=$used checkout=/home/newcomer
    chroot "$root" useradd --create-home --uid 1000 newcomer
    mounts
    find_traces >"$root/.before"
    mv "$built" "$root/var/tmp/"
    quietly apt-get update
    quietly "$APT install /var/tmp/$package"
    rm "$root/var/tmp/$package"
    use
    desktop
    helper
    take_away
}

quietly() { # quietly COMMAND: as root; its output only where it fails
    as root "$*" >"$root/.said" || { tail -n 15 "$root/.said"; wrong "$*"; }
}

check_parts() { # what the package is made from, by the system's own checkers
    quietly apt-get update
    quietly "$APT install desktop-file-utils appstream libxml2-utils"
    quietly desktop-file-validate packaging/deb/draglag.desktop
    quietly xmllint --noout packaging/deb/draglag.xml packaging/deb/draglag.metainfo.xml
    answer root appstreamcli validate --no-net packaging/deb/draglag.metainfo.xml '|| true' >"$root/.said"
    grep -q Validation "$root/.said" || wrong "appstreamcli did not check the metainfo"
    if grep -E '^[EW]:' "$root/.said" | grep -vFf packaging/deb/metainfo-known; then wrong "the metainfo is not valid"; fi
}

check_owners() { # nobody but root may write what is in the package, and nothing in it has rights of its own
    as root dpkg-deb --contents "dist/$package" >"$root/.said"
    awk '$2 != "root/root" || ($1 !~ /^l/ && (substr($1, 6, 1) == "w" || substr($1, 9, 1) == "w" || $1 ~ /[sS]/))' \
        "$root/.said" >"$root/.loose"
    [ ! -s "$root/.loose" ] || { head -n 5 "$root/.loose"; wrong "files of the package are not root's alone"; }
    say "[$package has $(wc -c <"$root$checkout/dist/$package") bytes]"
}

answer() { # answer ACCOUNT COMMAND: what it prints, without the line that as() says
    out=$(as "$@") || { say "$out"; wrong "$2 failed"; }
    printf '%s\n' "$out"
}

use() { # as a user who has an empty home
    case "$(answer newcomer draglag --version)" in "draglag "[0-9]*) ;; *) wrong "draglag --version says something else" ;; esac
    answer newcomer draglag demo --no-window >/dev/null
    for file in session.h5 report.html; do
        [ -s "$root$checkout/draglag-demo/$file" ] || wrong "draglag demo left no $file"
    done
    cp tests/deb/open_window.py "$root/var/tmp/"
    off="QT_QPA_PLATFORM=offscreen timeout 120 /opt/draglag/bin/python -I /var/tmp/open_window.py"
    case "$(answer newcomer "$off")" in *": empty") ;; *) wrong "the window did not open" ;; esac
    case "$(answer newcomer "$off draglag-demo/session.h5")" in *": session") ;; *) wrong "it did not open the session" ;; esac
    rm "$root/var/tmp/open_window.py"
    # On X and Wayland, too, Qt finds what its plugins load.
    out=$(answer root 'cd /opt/draglag/lib/python3*/site-packages/PySide6/Qt/plugins/platforms && ldd libqxcb.so libqwayland*.so')
    case "$out" in *"not found"*) printf '%s\n' "$out" | grep "not found" >&2; wrong "Depends lacks a library" ;; esac
    answer newcomer 'draglag devices' >/dev/null
    as newcomer 'test ! -w /opt/draglag && ! touch /opt/draglag/lib/x 2>/dev/null' || wrong "a user may write in /opt/draglag"
    quietly dpkg --verify draglag
    [ ! -s "$root/.said" ] || { cat "$root/.said"; wrong "files differ from those that were installed"; }
}

desktop() { # a double click: the type of a session, and the program of that type
    quietly "$APT install shared-mime-info desktop-file-utils libglib2.0-bin"
    answer newcomer "/opt/draglag/bin/python -I -c 'import h5py; h5py.File(\"$HDF\", \"w\")[\"x\"] = 1.0'" >/dev/null
    type_of() { answer newcomer "gio info -a standard::content-type $1" | sed -n 's/.*content-type: //p'; }
    found=$(type_of draglag-demo/session.h5)
    [ "$found" = application/x-draglag-session ] || wrong "a session is taken for $found"
    found=$(type_of "$HDF")
    case "$found" in application/x-hdf*) say "another program's *.h5 is $found" ;; *) wrong "another program's *.h5 is taken for $found" ;; esac
    case "$(answer newcomer gio mime application/x-draglag-session)" in
    *"draglag.desktop"*) ;;
    *) wrong "no program opens sessions" ;;
    esac
    for size in 16x16 48x48 256x256; do
        [ -s "$root/usr/share/icons/hicolor/$size/apps/draglag.png" ] || wrong "the icon lacks the size $size"
    done
}

helper() { # nobody has rights before the administrator gives them, for the interfaces named
    [ ! -e "$root$HELPER" ] || wrong "the EtherCAT helper is there unasked"
    quietly "$APT install gcc libc6-dev libcap2-bin"
    if as newcomer /usr/sbin/draglag-ethercat-setup eth77 >"$root/.said"; then wrong "a user may set up the helper"; fi
    quietly draglag-ethercat-setup eth77
    group=$(chroot "$root" getent group draglag | cut -d: -f3)
    case "$(chroot --userspec=1000:1000 --groups="$group" "$root" "$HELPER" --check 2>&1)" in
    *'"complete"'*) ;;
    *) wrong "a member cannot use the helper" ;;
    esac
    if as newcomer "$HELPER" --check >/dev/null; then wrong "others than members can use the helper"; fi
    case "$(chroot --userspec=1000:1000 --groups="$group" "$root" "$HELPER" lo 2>&1 </dev/null || true)" in
    *"sudo draglag-ethercat-setup lo"*) ;;
    *) wrong "another interface is not refused with the command that allows it" ;;
    esac
    rm "$root$HELPER"
    quietly dpkg-reconfigure draglag # as an upgrade does
    [ -x "$root$HELPER" ] || wrong "the helper is not renewed when the package is configured"
}

find_traces() { # what names draglag, outside of what the user made and of dpkg's own records of past actions
    (cd "$root" && find . -xdev \( -path ./proc -o -path ./sys -o -path ./home -o -path ./var/log -o -path ./var/lib/apt \
        -o -path ./var/cache \) -prune -o -iname '*draglag*' -print; grep -s draglag etc/group etc/gshadow) | sort
}

take_away() {
    answer root "/opt/draglag/bin/python -c 'import draglag_app'" >/dev/null
    touch "$root/opt/draglag/lib/left-by-root"
    quietly "$APT remove draglag"
    for place in /opt/draglag /usr/bin/draglag "$HELPER" /usr/lib/draglag /usr/share/draglag /usr/share/mime/packages/draglag.xml; do
        [ ! -e "$root$place" ] && [ ! -L "$root$place" ] || wrong "$place is left after apt remove"
    done
    [ -s "$root/etc/draglag/ethercat.conf" ] || wrong "apt remove took the administrator's settings"
    quietly "$APT purge draglag"
    find_traces >"$root/.after"
    diff "$root/.before" "$root/.after" || wrong "these are left after apt purge"
    case "$(answer root dpkg --audit)" in *draglag*) wrong "dpkg is not content" ;; esac
}

if [ "${1:-}" = --inside ]; then
    trial "$2" "$3"
    exit 0
fi
[ $# -gt 0 ] || set -- bookworm trixie
cases=
for name in "$@"; do
    case "$name" in bookworm | trixie) cases="$cases $name:root" ;; *)
        say "$name: no such system. Systems: bookworm trixie"
        exit 2
        ;;
    esac
done
# shellcheck disable=SC2086 # several
try_all $cases
