#!/usr/bin/env bash
# Debian packages that the tests (or, with the argument "bench", the benchmarks) need beside pip's;
# installed only when missing, and only as root.
set -euo pipefail
packages=(iproute2 iptables libfaketime libvulkan1 mesa-vulkan-drivers systemd)
[ "${1:-}" != bench ] || packages=(libegl1 libegl-mesa0 libgl1-mesa-dri)
missing=()
for package in "${packages[@]}"; do
    dpkg-query -W -f '${Status}' "$package" 2>/dev/null | grep -q 'ok installed' || missing+=("$package")
done
[ ${#missing[@]} -gt 0 ] || exit 0
if [ "$(id -u)" != 0 ] || ! command -v apt-get >/dev/null; then
    echo "not installed, what needs them will say so: ${missing[*]}" >&2
    exit 0
fi
apt-get update -qq
DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "${missing[@]}" >/dev/null
