#!/bin/sh
# Builds dist/draglag_VERSION_ARCHITECTURE.deb for the Debian (or Ubuntu) that this runs on: ./run deb
# The package holds a virtual environment of the system's own Python in /opt/draglag with all extras. It can only run with
# that minor version of Python, so each release of the system needs a package of its own, and VERSION names the system.
# DRAGLAG_LIBRARIES: the system libraries that Qt draws with, from ./run.
set -eu
cd "$(dirname "$0")/../.."
place=packaging/deb
umask 022
export LC_ALL=C.UTF-8 PYTHONDONTWRITEBYTECODE=1
ICON_SIZES_PX="16 24 32 48 64 128 256" # of the hicolor theme, for desktops that draw no SVG

say() { printf '%s\n' "$*" >&2; }
fail() { say "$1"; exit 1; }

for tool in dpkg-deb rsvg-convert; do
    command -v "$tool" >/dev/null || fail "$tool is missing: sudo apt-get install dpkg librsvg2-bin"
done
python=$(readlink -f /usr/bin/python3) || fail "The system's own Python is missing: sudo apt-get install python3 python3-venv"
interpreter=${python##*/} # python3.11: the name of the package that brings it, too
dpkg-query -W "$interpreter" >/dev/null 2>&1 || fail "$python is not from the package $interpreter: a package cannot depend on it"
"$python" -I -c 'import sys, venv, ensurepip; raise SystemExit(sys.version_info < (3, 11))' 2>/dev/null ||
    fail "Python 3.11 or newer with venv is needed: sudo apt-get install python3 python3-venv"
. /etc/os-release
upstream=$("$python" -I -c 'import tomllib; print(tomllib.load(open("pyproject.toml", "rb"))["project"]["version"])')
version=$upstream+$ID${VERSION_ID:-}
architecture=$(dpkg --print-architecture)

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
stage=$work/stage
site=$stage/opt/draglag/lib/$interpreter/site-packages

# --- /opt/draglag -----------------------------------------------------------------------------------------------------

fill_environment() {
    "$python" -I -m venv "$work/tools"
    "$python" -I -m venv --without-pip "$stage/opt/draglag"
    pip="$work/tools/bin/python -I -m pip --disable-pip-version-check"
    $pip wheel --quiet --no-deps --wheel-dir "$work" . || fail "The wheel cannot be built: pip's last lines are above."
    wheel=$(echo "$work"/draglag-*.whl)
    $pip --python "$stage/opt/draglag/bin/python" install --quiet --no-compile "${wheel}[all]" ||
        fail "draglag cannot be installed: pip's last lines are above. Check the network, then try again."
}

make_movable() { # what was written down of the place it was made in becomes /opt/draglag
    for program in "$stage"/opt/draglag/bin/*; do # of what other packages bring, nothing is for users of draglag
        case ${program##*/} in draglag | python*) ;; *) rm "$program" ;; esac
    done
    sed -i "1s|.*|#!/opt/draglag/bin/python|" "$stage/opt/draglag/bin/draglag"
    sed -i "s|$stage||g" "$stage/opt/draglag/pyvenv.cfg"
    ln -sfn "$python" "$stage/opt/draglag/bin/$interpreter"
    ln -sfn "$interpreter" "$stage/opt/draglag/bin/python3"
    ln -sfn "$interpreter" "$stage/opt/draglag/bin/python"
    # Where pip took the wheel from; the rest of RECORD is what was installed.
    rm -f "$site"/draglag-*.dist-info/direct_url.json
    sed -i '/direct_url.json/d' "$site"/draglag-*.dist-info/RECORD
    # Compiled here, for whoever runs it may not write there. Some packages hold files that do not compile.
    "$python" -I -m compileall -q --invalidation-mode unchecked-hash -s "$stage" -p / "$site" >/dev/null 2>&1 || true
    [ -n "$(find "$site/draglag_app" -name 'main.*.pyc')" ] || fail "The modules were not compiled."
    ! grep -rlIF "$work" "$stage" >&2 || fail "These files name the folder in which the package was built."
}

# --- what the desktop and the devices need ------------------------------------------------------------------------------

put() { install -D -m "$1" "$2" "$stage/$3"; }

place_files() {
    mkdir -p "$stage/usr/bin"
    ln -s /opt/draglag/bin/draglag "$stage/usr/bin/draglag"
    put 644 $place/draglag.desktop usr/share/applications/draglag.desktop
    put 644 $place/draglag.metainfo.xml usr/share/metainfo/draglag.metainfo.xml
    put 644 $place/draglag.xml usr/share/mime/packages/draglag.xml
    put 644 packaging/70-draglag.rules usr/lib/udev/rules.d/70-draglag.rules
    put 755 $place/draglag-ethercat-setup usr/sbin/draglag-ethercat-setup
    put 644 packaging/trusted.sh usr/share/draglag/trusted.sh
    put 755 packaging/ethercat/install.sh usr/share/draglag/ethercat/install.sh
    put 644 packaging/ethercat/draglag-ethercat-master.c usr/share/draglag/ethercat/draglag-ethercat-master.c
    put 644 packaging/ethercat/90-draglag-ethercat.rules usr/share/doc/draglag/examples/90-draglag-ethercat.rules
    mkdir -p "$stage/usr/share/doc/draglag"
    { cat $place/copyright; sed -e '1,4d' -e 's/^$/./' -e 's/^/ /' LICENSE; } >"$stage/usr/share/doc/draglag/copyright"
    gzip -9nc CHANGELOG.md >"$stage/usr/share/doc/draglag/changelog.gz"
    icon=resources/draglag_resources/icons/draglag.svg
    put 644 $icon usr/share/icons/hicolor/scalable/apps/draglag.svg
    for size in $ICON_SIZES_PX; do
        folder=$stage/usr/share/icons/hicolor/${size}x$size/apps
        mkdir -p "$folder"
        rsvg-convert -w "$size" -h "$size" -o "$folder/draglag.png" $icon
    done
}

# --- the package --------------------------------------------------------------------------------------------------------

depends() { # the interpreter it was made with, the C library its wheels were chosen for, what Qt draws with
    printf '%s, libc6 (>= %s)' "$interpreter" "$(ldd --version | sed -n '1s/.* //p')"
    for library in $DRAGLAG_LIBRARIES; do
        # Debian 13 renamed libraries whose interface has a 64-bit time.
        case $library in fonts-*) printf ', %s' "$library" ;; *) printf ', %s | %st64' "$library" "$library" ;; esac
    done
}

describe() {
    mkdir "$stage/DEBIAN"
    for script in preinst postinst prerm postrm; do install -m 755 $place/$script "$stage/DEBIAN/$script"; done
    (cd "$stage" && find opt usr -type f -print0 | sort -z | xargs -0 md5sum) >"$stage/DEBIAN/md5sums"
    cat >"$stage/DEBIAN/control" <<CONTROL
Package: draglag
Version: $version
Architecture: $architecture
Maintainer: The draglag authors
Installed-Size: $(du -k -s --exclude=DEBIAN "$stage" | cut -f1)
Depends: $(depends)
Recommends: shared-mime-info, desktop-file-utils, hicolor-icon-theme
Suggests: gcc, libc6-dev, libcap2-bin
Section: science
Priority: optional
Description: measure the drag latency of touchscreens
 draglag measures how far a touchscreen lags behind a stylus that is dragged over
 it, as a function of drag speed, with an interval and a verdict on every figure.
 It runs on a simulated rig, or with a laser sensor on EtherCAT, a Linux
 touchscreen and a WALT latency timer.
 .
 For rights on an EtherCAT bus: sudo draglag-ethercat-setup IFACE (needs the
 packages suggested).
CONTROL
}

say "Building draglag $version for $interpreter (some minutes)"
fill_environment
make_movable
place_files
chmod -R go-w "$stage" # a wheel may bring what its group may write
describe
mkdir -p dist
package=dist/draglag_${version}_$architecture.deb
# zstd, which dpkg reads since Debian 12: xz takes minutes for a package of this size, at each build and installation.
dpkg-deb --build --root-owner-group -Zzstd "$stage" "$package" >/dev/null
say "Built $package ($(du -h "$package" | cut -f1))"
