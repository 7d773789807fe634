#!/bin/bash
# Makes a Debian 12 machine ready for flowloom: system packages, the locked environment in .venv, the OpenVDB binding.
# `make` calls it before anything else and keeps a stamp, so that it runs once. It may be run again at any time.
# Exit codes: 0 ready, 3 something is missing that it may not install (one line says what to type).
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

UV_VERSION=0.13.9
PYTHON=/usr/bin/python3 # Debian's own: python3-dev has its headers
STAMP=.venv/flowloom.stamp

# Why each is needed. A minimal container lacks all of them; cmake and ninja come from PyPI where they are missing.
PACKAGES=(
    ca-certificates                         # PyPI over https
    python3 python3-venv python3-dev        # the interpreter, its ensurepip, its headers
    g++                                     # compiles the OpenVDB binding
    libopenvdb-dev libtbb-dev               # OpenVDB
    libboost-dev libboost-iostreams-dev     # OpenVDB's headers include them
    libopenvdb-tools                        # vdb_print: the tests ask OpenVDB's own tool
    ocl-icd-libopencl1 pocl-opencl-icd      # OpenCL on the CPU
    libllvm19                               # what Dr.Jit compiles kernels with; 14 to 16 abort
    libgl1 libopengl0                       # pymeshlab and its plug-ins are linked with them
)

say() { echo "set-up: $*" >&2; }
stop() { say "$*"; exit 3; }

# The user's Python, compiler and search paths must not reach into this: keep the network's settings, drop the rest.
if [ -z "${FLOWLOOM_CLEAN:-}" ]; then
    keep=(FLOWLOOM_CLEAN=1 "HOME=${HOME:-/tmp}" "PATH=/usr/sbin:/usr/bin:/sbin:/bin" "LANG=C.UTF-8")
    for name in http_proxy https_proxy no_proxy HTTP_PROXY HTTPS_PROXY NO_PROXY all_proxy ALL_PROXY SSL_CERT_FILE \
        SSL_CERT_DIR PIP_CERT PIP_INDEX_URL UV_DEFAULT_INDEX UV_CACHE_DIR XDG_CACHE_HOME TMPDIR TERM; do
        if [ -n "${!name:-}" ]; then keep+=("$name=${!name}"); fi
    done
    exec env -i "${keep[@]}" /bin/bash pipeline/setup.sh
fi

missing_packages() {
    local name
    for name in "${PACKAGES[@]}"; do
        if [ "$(dpkg-query -W -f='${db:Status-Status}' "$name" 2>/dev/null)" != installed ]; then echo "$name"; fi
    done
}

install_packages() {
    local sudo=() log=build/apt.log
    if [ "$(id -u)" != 0 ]; then sudo=(sudo -n); fi
    say "installing with apt: $*"
    mkdir -p build
    if ! { "${sudo[@]}" apt-get -q update &&
        "${sudo[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -q install -y --no-install-recommends "$@"; } \
        >"$log" 2>&1; then
        stop "apt-get failed ($(grep '^E:' "$log" | head -1)); the whole answer is in $log; then run: apt-get install $*"
    fi
}

command -v dpkg-query >/dev/null || stop "needs Debian 12; elsewhere install what pipeline/setup.sh lists, then run: uv sync --locked"
mapfile -t missing < <(missing_packages)
if [ ${#missing[@]} != 0 ]; then
    if [ "$(id -u)" != 0 ] && ! sudo -n true 2>/dev/null; then
        stop "run this first, as root: apt-get install -y --no-install-recommends ${missing[*]}"
    fi
    install_packages "${missing[@]}"
fi

"$PYTHON" -c 'import sys; sys.exit(not (3, 11) <= sys.version_info[:2] < (3, 13))' ||
    stop "$PYTHON is $("$PYTHON" -V); flowloom needs Python 3.11 or 3.12, which Debian 12 has"

# One list of authorities for pip and uv, the system's: it also knows those of a company's proxy.
export SSL_CERT_FILE=${SSL_CERT_FILE:-/etc/ssl/certs/ca-certificates.crt}
export PIP_CERT=${PIP_CERT:-$SSL_CERT_FILE} PIP_DISABLE_PIP_VERSION_CHECK=1

uv=build/tools/bin/uv
if [ "$("$uv" --version 2>/dev/null | cut -d' ' -f2)" != "$UV_VERSION" ]; then
    say "installing uv $UV_VERSION into build/tools"
    rm -rf build/tools
    "$PYTHON" -m venv build/tools
    build/tools/bin/python -m pip install --quiet "uv==$UV_VERSION" ||
        stop "uv $UV_VERSION could not be had from PyPI; is there a network? Run the same command again"
fi

say "the locked environment in .venv (the first time also the OpenVDB binding: about a minute)"
"$uv" sync --quiet --locked --python "$PYTHON" ||
    stop "uv sync failed (see above); fix it and run the same command again"
touch "$STAMP"
say "ready"
