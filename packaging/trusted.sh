# Sourced by the installers: whether a path is the administrator's alone. POSIX sh. The installers have set PATH.

fail() { echo "$1" >&2; exit 1; }

umask 022
command -v findmnt >/dev/null || fail "findmnt is missing: sudo apt install util-linux"
# In an environment that nobody but this script has filled.
clean() { env -i PATH="$PATH" LANG=C.UTF-8 HOME=/root "$@"; }

known=: # what was found to be owned: only root can have changed that since
owned() { # owned PATH: root's, and writable by nobody else; a link is judged by where it leads
    case $1 in *:*) ;; *) case $known in *":$1:"*) return 0 ;; esac ;; esac
    [ -n "$(find "$1" -maxdepth 0 -user 0 \( -type l -o ! -perm /022 \) 2>/dev/null)" ] || return 1
    # Media that users take away, and what they mount themselves, say of anything that it is root's. Such file systems
    # are mounted nosuid: the kernel, too, takes no rights from them.
    [ -L "$1" ] || case ",$(findmnt -n -o OPTIONS -T "$1")," in *,nosuid,* | ,,) return 1 ;; esac
    known=$known$1:
}

trusted() { # trusted PATH: each component, as given and through every link, is owned; else names the first in $loose
    loose=$1
    case $1 in /*) ;; *) return 1 ;; esac
    rest=${1#/} here='' links=40
    owned / || { loose=/; return 1; }
    while [ -n "$rest" ]; do
        part=${rest%%/*}
        case $rest in */*) rest=${rest#*/} ;; *) rest='' ;; esac
        case $part in
        '' | .) continue ;;
        ..) here=${here%/*}; continue ;;
        esac
        loose=$here/$part
        if [ ! -e "$loose" ] && [ ! -L "$loose" ]; then
            [ "${2:-}" = or-absent ] && return 0 # nobody but root can make it
            return 1
        fi
        owned "$loose" || return 1
        if [ -L "$loose" ]; then
            links=$((links - 1))
            [ "$links" -gt 0 ] || return 1
            to=$(readlink "$loose")
            case $to in /*) here='' ;; esac
            rest=${to#/}${rest:+/$rest}
        else
            here=$loose
        fi
    done
    return 0
}

all_trusted() { # all_trusted FOLDER: everything in it, too, and where its links lead
    trusted "$1" || return 1
    loose=$(find -H "$1" \( ! -user 0 -o -perm /022 ! -type l \) -print -quit 2>/dev/null)
    [ -z "$loose" ] || return 1
    links_of=$(find -H "$1" -type l 2>/dev/null)
    [ -n "$links_of" ] || return 0
    while IFS= read -r link; do
        trusted "$link" or-absent || return 1
    done <<LINKS
$links_of
LINKS
}

as_member() { # as_member GROUP COMMAND …: as an account that owns nothing, in one group
    group=$1
    shift
    clean setpriv --reuid=65534 --regid="$group" --clear-groups -- "$@"
}
