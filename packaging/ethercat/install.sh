#!/bin/sh
# Lets members of the group draglag use an EtherCAT terminal, without running draglag as root:
#   sudo packaging/ethercat/install.sh [PYTHON]     PYTHON: the interpreter that has draglag, default /usr/bin/python3
#   sudo packaging/ethercat/install.sh --remove
set -eu
here=$(cd "$(dirname "$0")" && pwd)
target=${DRAGLAG_LIBDIR:-/usr/local/lib/draglag}
helper=$target/draglag-ethercat-master

fail() { echo "$1" >&2; exit 1; }
[ "$(id -u)" = 0 ] || fail "This needs the administrator's rights: sudo $0 $*"

if [ "${1:-}" = --remove ]; then
    rm -f "$helper"
    rmdir "$target" 2>/dev/null || true
    echo "Removed $helper. The group draglag was left alone."
    exit 0
fi

python=${1:-/usr/bin/python3}
for tool in cc setcap getent groupadd; do
    command -v $tool >/dev/null || fail "$tool is missing: sudo apt install gcc libcap2-bin passwd"
done
[ -x "$python" ] || fail "$python is not an interpreter"
package=$("$python" -I -c 'import os, draglag_devices; print(os.path.dirname(draglag_devices.__file__))') ||
    fail "$python does not have draglag: name the interpreter that has, as the first argument"
"$python" -I -c 'import pysoem' || fail "$python does not have pysoem: $python -m pip install pysoem"

# Whoever may change these files could use the capabilities for something else.
site=$("$python" -I -c 'import os, pysoem; print(os.path.dirname(os.path.dirname(pysoem.__file__)))')
for place in "$package" "$site" "$(readlink -f "$python")"; do
    loose=$(find "$place" \( ! -user root -o -perm /022 \) ! -type l -print -quit)
    [ -z "$loose" ] || fail "$loose can be changed by others than root: install draglag system-wide (root-owned) first"
done

getent group draglag >/dev/null || groupadd --system draglag
mkdir -p "$target"
rm -f "$helper"
cc -O2 -Wall -Wextra -Werror -DDRAGLAG_PYTHON="\"$python\"" -o "$helper" "$here/draglag-ethercat-master.c"
chown root:draglag "$helper"
chmod 0750 "$helper"
# After chown, which clears capabilities.
setcap cap_net_raw,cap_net_admin=ep "$helper"
echo "Installed $helper."
echo "Add each operator to the group, then log in again:  sudo usermod -aG draglag NAME"
