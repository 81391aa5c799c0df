#!/bin/sh
# Installs draglag into /opt/draglag, owned by root, and the helper for EtherCAT on the interfaces named:
#   sudo ./run install [IFACE …]     without a name: on wired interfaces that have no address
#   sudo ./run install --remove
# What is installed is a copy: the checkout may be changed or removed afterwards.
set -eu
# Tools by the system's own path, and folders where they are, whatever the caller's environment says.
PATH=/usr/sbin:/usr/bin:/sbin:/bin
export PATH
unset CDPATH
place=$(cd "$(dirname "$0")" && pwd)
. "$place/trusted.sh"
home=/opt/draglag
link=/usr/local/bin/draglag

[ "$(id -u)" = 0 ] || fail "This needs the administrator's rights: sudo ./run install $*"
if [ "${1:-}" = --remove ]; then
    "$place/ethercat/install.sh" --remove
    [ "$(readlink "$link" 2>/dev/null)" != "$home/bin/draglag" ] || rm -f "$link"
    rm -rf "$home"
    echo "Removed $home."
    exit 0
fi
case $(dpkg-query -W -f '${Status}' draglag 2>/dev/null) in
*" installed") fail "The package draglag has $home. For EtherCAT: sudo draglag-ethercat-setup eth1; to remove it: sudo apt remove draglag" ;;
esac
for name in "$@"; do
    case $name in -*) fail "$name: expected names of network interfaces, or --remove" ;; esac
done

python=
for candidate in /usr/bin/python3.13 /usr/bin/python3.12 /usr/bin/python3.11 /usr/bin/python3; do
    [ -x "$candidate" ] || continue
    trusted "$candidate" || fail "$loose can be changed by others than root"
    # Without site (-S): no module from a folder that others may have been given is run as root.
    if clean "$candidate" -I -S -c 'import sys, venv, ensurepip; raise SystemExit(sys.version_info < (3, 11))' 2>/dev/null; then
        python=$candidate
        break
    fi
done
[ -n "$python" ] || fail "Python 3.11 or newer with venv is needed: sudo apt install python3 python3-venv"
trusted "${home%/*}" || fail "$loose can be changed by others than root, or is not there: $home is to be root's alone"

# From a copy that nobody else can change while it is built.
source=$(mktemp -d "$home.source.XXXXXX")
before=
restore() {
    rm -rf "$source"
    [ -z "$before" ] || { rm -rf "$home"; [ ! -d "$before" ] || mv "$before" "$home"; }
}
trap restore EXIT
trap 'exit 1' HUP INT TERM
cp -R "$place/../pyproject.toml" "$place/../README.md" "$place/../LICENSE" "$place/../app" "$place/../core" \
    "$place/../devices" "$place/../resources" "$source"
chown -R root:root "$source"
before=$home.before
rm -rf "$before"
[ ! -e "$home" ] || mv "$home" "$before"
echo "Installing draglag into $home (this takes a minute or two)"
clean "$python" -I -S -m venv "$home"
clean "$home/bin/python" -I -m pip install --quiet --disable-pip-version-check --no-cache-dir "${source}[all]" ||
    fail "Could not install draglag into $home: pip's last lines are above. Check the network, then try again."
chmod -R go-w "$home" # a wheel may bring what its group may write
clean "$home/bin/python" -I -c 'import draglag_app'
old=$before
before=
rm -rf "$old"
ln -sfn "$home/bin/draglag" "$link"
echo "Installed $home. The command is $link."

if [ $# -eq 0 ]; then
    # shellcheck disable=SC2046 # names without blanks
    set -- $(clean "$home/bin/python" -I -c '
from draglag_devices.ethercat_laser.probe import scan_bus
print(*(seen["name"] for seen in scan_bus(send=False) if not seen["left_alone"]))')
    [ $# -gt 0 ] || {
        echo "No EtherCAT helper: each wired interface has an address. Name the one of the bus: sudo ./run install eth1"
        exit 0
    }
fi
"$place/ethercat/install.sh" "$home/bin/python" "$@"
