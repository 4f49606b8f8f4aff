#!/usr/bin/env bash
# Makes .venv with what peakmark needs, with the argument "test" also what its tests and checks need; called by make, once
# for each change of pyproject.toml.
# System packages are installed with apt-get where that is allowed; otherwise the exact line is printed and set-up goes on.
set -euo pipefail
cd "$(dirname "$0")/.."

extra='[sim]'
[[ ${1:-} == test ]] && extra='[test]'

say() { printf 'install: %s\n' "$*"; }

apt_install() {   # apt_install WHY PACKAGE...: succeeds only if the packages are there afterwards
  local why=$1; shift
  if [[ $(id -u) == 0 ]] && command -v apt-get >/dev/null; then
    say "$why: apt-get install $*"
    if { DEBIAN_FRONTEND=noninteractive apt-get install -qq -y --no-install-recommends "$@" >/dev/null 2>&1; } ||
       { apt-get update -qq && DEBIAN_FRONTEND=noninteractive apt-get install -qq -y --no-install-recommends "$@" >/dev/null; }; then
      return 0
    fi
  fi
  say "$why: missing. To have it, run:"
  printf '    sudo apt-get update && sudo apt-get install -y %s\n' "$*"
  return 1
}

python=
for candidate in python3.13 python3.12 python3.11 python3 python; do
  if command -v "$candidate" >/dev/null && "$candidate" -c 'import sys; sys.exit(not (3, 11) <= sys.version_info < (3, 14))' 2>/dev/null; then
    python=$candidate; break
  fi
done
[[ -n $python ]] || { say "expected Python 3.11, 3.12 or 3.13 on the PATH, found none"; exit 2; }

if ! "$python" -c 'import ensurepip, venv' 2>/dev/null; then
  apt_install "Python's venv module" python3-venv || exit 2
fi
[[ -x .venv/bin/python ]] && .venv/bin/python -m pip --version >/dev/null 2>&1 || { rm -rf .venv; "$python" -m venv .venv; }
say "Python packages into .venv (a minute or two the first time)"
.venv/bin/python -m pip install --quiet --disable-pip-version-check --editable ".$extra"

has_library() { .venv/bin/python -c "import ctypes, sys; ctypes.CDLL('$1')" 2>/dev/null; }
gl_packages=(libegl1 libgl1 libgl1-mesa-dri libosmesa6)
if ! { has_library libEGL.so.1 && has_library libGL.so.1 && has_library libOSMesa.so.8; }; then
  apt_install "OpenGL for off-screen rendering" "${gl_packages[@]}" ||
    say "going on without OpenGL: planar scenes are drawn by the exact renderer"
fi
if [[ $extra == "[test]" ]] && ! has_library libatomic.so.1; then
  apt_install "libatomic, which Mitsuba and Playwright use in the tests" libatomic1 || true
fi
if [[ $extra == "[test]" ]] && ! { has_library libLLVM-19.so || has_library libLLVM.so.19.1; }; then
  apt_install "LLVM for path-traced images" libllvm19 || true
fi
if [[ $extra == "[test]" ]] && ! command -v pdftoppm >/dev/null; then
  apt_install "poppler, which the tests of printed sheets use" poppler-utils || true
fi
if [[ $extra == "[test]" ]] && ! command -v chromium >/dev/null && ! command -v chromium-browser >/dev/null; then
  apt_install "chromium, in which the tests look at reports" chromium || true
fi
say "ready"
