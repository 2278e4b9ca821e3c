# Sourced by scripts that need programs which the system may lack: puts Debian packages, and what they depend on, under
# target/debian-tools and adds them to the paths. Nothing is installed or removed, and no rights are needed.
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
    command -v apt-get >/dev/null || { echo "missing, and this is no Debian: ${wanted[*]}" >&2; return 1; }
    debian_fetch "${wanted[@]}" || {
      # The list of packages may be old or missing; only an administrator can renew it.
      [ "$(id -u)" = 0 ] && apt-get update -qq && debian_fetch "${wanted[@]}"
    } || {
      echo "cannot download ${wanted[*]}: renew the list of packages (apt-get update) or install them" >&2
      return 1
    }
  fi
  debian_tools_paths
}

# Packages with what they need and the system lacks; an installation is only simulated to learn that.
debian_fetch() {
  local lacking
  lacking=$(apt-get install --simulate --no-install-recommends "$@" | sed -n 's/^Inst \([^ ]*\).*/\1/p') || return 1
  debian_unpack $lacking
}

# Downloads these packages, without what they depend on, and unpacks them.
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
