#!/usr/bin/env bash
# A Docker engine and a base image for the compose test, where there is none yet.
#
#   tests/docker-engine.sh up     what is missing: packages, engine, base image; says what it did
#   tests/docker-engine.sh down   end the engine, if `up` started it; images are kept
#
# Where an engine answers, it is used as it is, and the base image is pulled as anywhere.  On Debian 12
# as root without an engine (a bare continuous integration machine), Docker is installed, and where no
# image registry can be reached a stand-in for the base image is made of this machine's own files.
# Names and places may be set: DOCKER_UP_IMAGE, DOCKER_UP_STATE.
set -euo pipefail

image=${DOCKER_UP_IMAGE:-python:3.11-slim-bookworm}
state=${DOCKER_UP_STATE:-/var/lib/docker-up}
pid_file=$state/dockerd.pid
bundle=${PIP_CERT:-/etc/ssl/certs/ca-certificates.crt}  # of authorities that pip trusts here
mirror=$(sed -n 's/^URIs: *\(.*\/debian\)\/*$/\1/p' /etc/apt/sources.list.d/*.sources 2>/dev/null | head -1)

answers() { docker version >/dev/null 2>&1; }
cannot() { echo "no Docker: $*" >&2; exit 1; }

install_docker() {
    local wanted=()
    command -v dockerd >/dev/null || wanted+=(docker.io containerd)
    command -v docker >/dev/null || wanted+=(docker-cli)
    docker compose version >/dev/null 2>&1 || wanted+=(docker-compose)
    docker buildx version >/dev/null 2>&1 || wanted+=(docker-buildx)
    [ ${#wanted[@]} -gt 0 ] || return 0
    [ -n "$mirror" ] || cannot "it is not installed, and this is not Debian"
    echo "installing ${wanted[*]}"
    # Debian 12 has no compose v2.  Debian 13's packages run on it; they, and nothing else, are taken
    # from there, by lists of our own: the machine's stay as they are.
    mkdir -p "$state"/apt/{lists/partial,preferences.d}
    local keys=/usr/share/keyrings/debian-archive-keyring.gpg
    printf 'deb [signed-by=%s] %s %s main\n' $keys "$mirror" bookworm $keys "$mirror" bookworm-updates \
        $keys "${mirror%/debian}/debian-security" bookworm-security $keys "$mirror" trixie \
        >"$state/apt/sources.list"
    printf 'Package: *\nPin: release n=trixie\nPin-Priority: -1\n\nPackage: %s\nPin: release n=trixie\nPin-Priority: 600\n' \
        'docker.io docker-cli docker-compose docker-buildx containerd' >"$state/apt/preferences.d/newer"
    local apt=(apt-get -qq -o Dir::Etc::SourceList="$state/apt/sources.list" -o Dir::Etc::SourceParts=/dev/null
        -o Dir::Etc::PreferencesParts="$state/apt/preferences.d" -o Dir::State::Lists="$state/apt/lists"
        -o DPkg::Lock::Timeout=300)
    "${apt[@]}" update
    DEBIAN_FRONTEND=noninteractive "${apt[@]}" install -y --no-install-recommends "${wanted[@]}" >"$state/apt.log" 2>&1 \
        || cannot "apt-get install ${wanted[*]} failed, see $state/apt.log"
}

start_engine() {
    rm -f /var/run/docker.pid /var/run/docker/containerd/containerd.pid  # of one that was killed
    # Networks of containers must not exceed the uplink's packets.
    local uplink mtu=1500
    uplink=$(ip -o route show default | sed -n 's/.* dev \([^ ]*\).*/\1/p;q')
    [ -z "$uplink" ] || mtu=$(cat "/sys/class/net/$uplink/mtu")
    [ "$mtu" -le 1500 ] || mtu=1500
    setsid nohup dockerd --mtu "$mtu" --default-network-opt "bridge=com.docker.network.driver.mtu=$mtu" \
        >>"$state/dockerd.log" 2>&1 </dev/null &
    echo $! >"$pid_file"
    for _ in $(seq 150); do
        if answers; then
            # The engine has set this to DROP, which would also cut bridges between network namespaces.
            iptables -P FORWARD ACCEPT
            echo "engine: started"
            return
        fi
        kill -0 "$(cat "$pid_file")" 2>/dev/null || break
        sleep 0.2
    done
    cannot "dockerd does not come up, see $state/dockerd.log"
}

# A stand-in: this machine's own Debian packages (the essential ones, and the libraries of its Python),
# file by file, and that Python; some seconds, nothing is fetched.
make_image() {
    mkdir -p "$state"
    [ "$(id -u)" = 0 ] || cannot "\"$image\" can neither be pulled nor, without root, be made"
    command -v dpkg-query >/dev/null || cannot "\"$image\" cannot be pulled, and this is not Debian"
    local minor python root
    minor=$(sed -n 's/^python:\(3\.[0-9]*\).*/\1/p' <<<"$image")
    python=$("python$minor" -c 'import sys; print(sys.base_prefix)' 2>/dev/null) || true
    case $python in ''|/usr) cannot "\"$image\" cannot be pulled, and there is no Python $minor to make it of";; esac
    echo "making $image of this machine's Debian and $python"
    work=$(mktemp -d)  # not local: the trap reads it at the end
    trap 'rm -rf "$work"' EXIT
    root=$work/root
    mkdir -p "$root"/{dev,etc,opt,proc,root,run,sys,tmp,var/{cache,lib,tmp},usr/{bin,sbin,lib,lib64,local}}
    chmod 1777 "$root/tmp" "$root/var/tmp"
    local folder
    for folder in bin sbin lib lib64; do ln -s "usr/$folder" "$root/$folder"; done
    local kept=(libssl3 libffi8 libsqlite3-0 libreadline8 libncursesw6 libexpat1 libuuid1 libbz2-1.0 liblzma5
        zlib1g libstdc++6 netbase passwd)
    local essential
    mapfile -t essential < <(dpkg-query -W -f '${Essential} ${Package}\n' | sed -n 's/^yes //p')
    apt-cache depends --recurse --installed --important "${essential[@]}" "${kept[@]}" | grep '^[a-z]' \
        | { xargs dpkg -L 2>/dev/null || true; } | sed -E 's#^/(bin|sbin|lib|lib64)/#/usr/\1/#' \
        | grep -vE '^/(var|usr/share/(doc|man|info|locale|lintian|perl))/' | sort -u \
        | while read -r path; do if [ -f "$path" ] || [ -L "$path" ]; then echo "${path#/}"; fi; done \
        | tar -C / -cf - -T - | tar -C "$root" -xf -
    cp "$root/usr/share/base-passwd/passwd.master" "$root/etc/passwd"
    cp "$root/usr/share/base-passwd/group.master" "$root/etc/group"
    mkdir -p "$root${bundle%/*}"
    cp "$bundle" "$root$bundle"
    tar -C "$python" -cf - --exclude='lib/python*/site-packages/*' --exclude='lib/python*/test' \
        --exclude='lib/python*/config-*' --exclude=__pycache__ --exclude='*.a' \
        bin/python3 "bin/python$minor" lib include | tar -C "$root/usr/local" -xf -
    ln -sf python3 "$root/usr/local/bin/python"
    chroot "$root" ldconfig
    chroot "$root" python3 -m ensurepip >"$state/image.log" 2>&1 || cannot "pip is missing in it, see $state/image.log"
    ln -sf pip3 "$root/usr/local/bin/pip"
    tar -C "$root" -c . \
        | docker import --change 'ENV PATH=/usr/local/bin:/usr/local/sbin:/usr/sbin:/usr/bin:/sbin:/bin LANG=C.UTF-8' \
            --change "ENV PIP_CERT=$bundle SSL_CERT_FILE=$bundle PIP_DEFAULT_TIMEOUT=180 PIP_DISABLE_PIP_VERSION_CHECK=1" \
            --change 'CMD ["python3"]' - "$image" >/dev/null
}

case ${1:-} in
up)
    if ! answers; then
        [ "$(id -u)" = 0 ] || cannot "no engine answers, and to start one needs root"
        mkdir -p "$state"
        install_docker
        start_engine
    fi
    docker compose version >/dev/null 2>&1 || cannot "docker compose is not installed"
    docker image inspect "$image" >/dev/null 2>&1 || timeout 300 docker pull -q "$image" 2>/dev/null || make_image
    ;;
down)
    [ -s "$pid_file" ] || exit 0
    pid=$(cat "$pid_file")
    if grep -qs dockerd "/proc/$pid/cmdline"; then
        kill "$pid"
        timeout 30 tail --pid="$pid" -f /dev/null
    fi
    rm -f "$pid_file"
    ;;
*) cannot "usage: $0 up|down" ;;
esac
