# Sourced by scripts that need programs which may be missing: unpacks Debian packages, with their dependencies, under
# target/debian-tools and adds them to the paths. Nothing is installed or removed, and no privileges are needed.
#
#   . tests/debian-tools.sh
#   debian_tools qemu-system-arm:qemu-system-arm arm-none-eabi-gcc:gcc-arm-none-eabi    # program:package, from the root

debian_tools_folder=$PWD/target/debian-tools

debian_tools() {
  local wanted=() pair
  for pair in "$@"; do
    PATH=$debian_tools_folder/usr/bin:$debian_tools_folder/usr/sbin:$debian_tools_folder/bin:$debian_tools_folder/sbin:$PATH \
      command -v "${pair%%:*}" >/dev/null || wanted+=("${pair#*:}")
  done
  if [ ${#wanted[@]} -gt 0 ]; then
    command -v apt-get >/dev/null || { echo "missing, and this is not Debian: ${wanted[*]}" >&2; return 1; }
    debian_fetch "${wanted[@]}" || {
      # The package list may be old or missing; only an administrator can update it.
      [ "$(id -u)" = 0 ] && apt-get update -qq && debian_fetch "${wanted[@]}"
    } || {
      echo "cannot download ${wanted[*]}: update the package list (apt-get update) or install them" >&2
      return 1
    }
  fi
  debian_tools_paths
}

# The same for a package that has files but no program: debian_files avr-libc:usr/lib/avr/include/avr/io.h
debian_files() {
  local pair
  for pair in "$@"; do
    [ -e "/${pair#*:}" ] || [ -e "$debian_tools_folder/${pair#*:}" ] || debian_unpack "${pair%%:*}" || return 1
  done
}

# Packages and their missing dependencies; an installation is only simulated to find those out.
debian_fetch() {
  local lacking
  lacking=$(apt-get install --simulate --no-install-recommends "$@" | sed -n 's/^Inst \([^ ]*\).*/\1/p') || return 1
  debian_unpack $lacking
}

# Downloads these packages, without their dependencies, and unpacks them.
debian_unpack() {
  local debs=$debian_tools_folder/debs deb
  rm -rf "$debs"
  mkdir -p "$debs"
  (cd "$debs" && apt-get download -qq "$@" 2>"$debs/log") || { cat "$debs/log" >&2; return 1; }
  for deb in "$debs"/*.deb; do
    dpkg-deb -x "$deb" "$debian_tools_folder" || return 1
  done
  rm -r "$debs"
}

debian_tools_paths() {
  local root=$debian_tools_folder
  [ -d "$root" ] || return 0
  export PATH=$PATH:$root/usr/bin:$root/usr/sbin:$root/bin:$root/sbin
  export LD_LIBRARY_PATH=${LD_LIBRARY_PATH:+$LD_LIBRARY_PATH:}$root/usr/lib/x86_64-linux-gnu:$root/lib/x86_64-linux-gnu
}
