#!/bin/sh
# Lets members of the group draglag use an EtherCAT terminal on the interfaces named, without running draglag as root:
#   sudo packaging/ethercat/install.sh [PYTHON] IFACE …   PYTHON: the interpreter that has draglag, as an absolute path,
#                                                         default /opt/draglag/bin/python (./run install makes it)
#   sudo packaging/ethercat/install.sh --remove
# Nothing is run before every component of its path, as given and through every link, was found to be root's alone.
# SECURITY.md says against whom.
set -eu
# Tools by the system's own path, and folders where they are, whatever the caller's environment says.
PATH=/usr/sbin:/usr/bin:/sbin:/bin
export PATH
unset CDPATH
place=$(cd "$(dirname "$0")" && pwd)
. "$place/../trusted.sh"
case $place in
/usr/share/draglag/*) # the Debian package's
    lib=/usr/lib/draglag install="sudo draglag-ethercat-setup"
    again="install the package again: sudo apt install --reinstall draglag"
    ;;
*)
    lib=/usr/local/lib/draglag install="sudo ./run install"
    again="make an installation that is root's alone first: $install"
    ;;
esac
helper=$lib/draglag-ethercat-master

[ "$(id -u)" = 0 ] || fail "This needs the administrator's rights: sudo $0 $*"

if [ "${1:-}" = --remove ]; then
    rm -f "$helper"
    rmdir "$lib" 2>/dev/null || true
    echo "Removed $helper. The group draglag was left alone."
    exit 0
fi

python=/opt/draglag/bin/python
case "${1:-}" in /*) python=$1; shift ;; esac
interfaces=
for name in "$@"; do
    case $name in
    -* | *[!A-Za-z0-9._:@-]* | '' | ????????????????*) fail "“$name” cannot be the name of a network interface" ;;
    esac
    interfaces=${interfaces:+$interfaces,}$name
    [ -e "/sys/class/net/$name" ] || echo "There is no interface $name at present." >&2
done
[ -n "$interfaces" ] || fail "Name the interface that the coupler is plugged into: sudo $0 $python eth1"

# --- the interpreter: looked at before it is run ---

case $python in *[!A-Za-z0-9/._+-]*) fail "$python: name the interpreter without blanks and quotes" ;; esac
changed() { fail "$loose can be changed by others than root, is not there or is on a medium mounted nosuid: $again"; }
trusted "$python" || changed
[ -f "$python" ] && [ -x "$python" ] || fail "$python is not an interpreter"
for settings in "${python%/*}/pyvenv.cfg" "${python%/*/*}/pyvenv.cfg"; do
    trusted "$settings" or-absent || changed
    [ -f "$settings" ] || continue
    base=$(sed -n 's/^[[:space:]]*[Hh][Oo][Mm][Ee][[:space:]]*=[[:space:]]*//p' "$settings")
    [ -z "$base" ] || trusted "$base" || changed
done
for tool in cc setcap getent groupadd setpriv; do
    found=$(command -v "$tool") || fail "$tool is missing: sudo apt install gcc libc6-dev libcap2-bin passwd util-linux"
    trusted "$found" || changed
done
getent group draglag >/dev/null || groupadd --system draglag
group=$(getent group draglag | cut -d: -f3)

# --- what it would run: asked of it as an account without rights, looked at before it gets any ---

nobody=65534 # not the group draglag, whose members may start a helper that is installed already
asked=$(as_member "$nobody" "$python" -I -c '
import os, sys, sysconfig
from importlib import metadata, util
for entry in sys.path:
    print("path", entry)
homes = {os.path.realpath(sysconfig.get_path(kind)) for kind in ("purelib", "platlib")}
homes |= {entry for entry in map(os.path.realpath, sys.path) if entry.endswith("/dist-packages")}
for name in ("draglag", "draglag_devices", "draglag_resources", "pysoem"):
    found = util.find_spec(name)
    if found is None:
        print("lacks", name)
    else:
        folder = os.path.dirname(os.path.realpath(found.origin))
        print("path", folder)
        if os.path.dirname(folder) not in homes:
            print("elsewhere", folder)
if "\"editable\": true" in (metadata.distribution("draglag").read_text("direct_url.json") or ""):
    print("elsewhere", "the checkout it was installed from")
' 2>/dev/null) || fail "$python cannot be run by members of the group draglag, or does not have draglag: $again"
while read -r kind what; do
    case $kind in
    lacks) fail "$python does not have $what: $again" ;;
    elsewhere) fail "$python runs draglag from $what, an editable installation: $again" ;;
    path) if [ -d "$what" ]; then all_trusted "$what" || changed; else trusted "$what" or-absent || changed; fi ;;
    esac
done <<ASKED
$asked
ASKED
for library in $(as_member "$nobody" ldd "$python" 2>/dev/null | grep -o '/[^ ]*' || true); do
    trusted "$library" || changed
done

# --- the helper ---

mkdir -p "$lib"
trusted "$lib" || changed
new=$(mktemp "$lib/.new.XXXXXX")
trap 'rm -f "$new"' EXIT
clean cc -O2 -Wall -Wextra -Werror -DDRAGLAG_PYTHON="\"$python\"" -DDRAGLAG_INTERFACES="\"$interfaces\"" \
    -DDRAGLAG_INSTALL="\"$install\"" -o "$new" "$place/draglag-ethercat-master.c"
chown "root:$group" "$new"
chmod 0750 "$new"
setcap cap_net_raw,cap_net_admin=ep "$new" # after chown, which clears capabilities
# Installed is what a member can use.
answer=$(as_member "$group" "$new" --check 2>&1 </dev/null) || true
case $answer in
*'"complete"'*) ;;
*)
    answer=$(printf '%s' "$answer" | tail -n 1)
    fail "The helper does not work for members of the group draglag and was not installed: ${answer:-it cannot be executed}"
    ;;
esac
mv -f "$new" "$helper"
echo "Installed $helper for $interfaces."
echo "Add each operator to the group, then log in again:  sudo usermod -aG draglag NAME"
