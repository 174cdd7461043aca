#!/bin/sh
# Installs the OpenGL libraries that draw without a display, where that can be done. Never fails.
packages="libegl1 libegl-mesa0 libgl1-mesa-dri libosmesa6 libgl1"

missing=""
if command -v dpkg-query >/dev/null 2>&1; then
    for p in $packages; do
        case "$(dpkg-query -W -f '${Status}' "$p" 2>/dev/null)" in
            *"ok installed"*) ;;
            *) missing="$missing $p" ;;
        esac
    done
    [ -z "$missing" ] && exit 0
fi

if [ -n "$missing" ] && command -v apt-get >/dev/null 2>&1 && [ "$(id -u)" = 0 ]; then
    echo "installing OpenGL without a display:$missing"
    export DEBIAN_FRONTEND=noninteractive
    log=$(mktemp)
    if { apt-get -q update && apt-get -q -o DPkg::Lock::Timeout=60 install -y --no-install-recommends $missing; } \
        >"$log" 2>&1; then
        rm -f "$log"
        exit 0
    fi
    tail -n 3 "$log" >&2
    rm -f "$log"
fi
echo "note: OpenGL without a display may be missing; pictures then come from Warp's ray caster (slower)." >&2
echo "      Debian and Ubuntu: sudo apt-get install $packages" >&2
exit 0
