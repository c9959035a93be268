# SPDX-License-Identifier: Apache-2.0
# Bash completion for raystage. Commands, sub-commands, options and their choices are read from --help when
# they are first asked for, and cached until the shell ends.

declare -gA _raystage_help_texts

# Reads the help of "PROGRAM WORD..." into the caller's arrays: commands, options (an option's type by its
# name; empty where it takes no value).
_raystage_read_help() {
    local key="$*" line names type name section
    if [[ -z ${_raystage_help_texts[$key]+set} ]]; then
        _raystage_help_texts[$key]=$("$@" --help 2>/dev/null </dev/null)
    fi
    commands=()
    options=()
    while IFS= read -r line; do
        case $line in
            Commands: | Subcommands:) section=commands && continue ;;
            [![:space:]]* | '') section= ;;
        esac
        if [[ $section == commands ]]; then
            [[ $line =~ ^\ \ ([a-z][^ ]*) ]] && commands+=("${BASH_REMATCH[1]}")
            continue
        fi
        [[ $line =~ ^\ \ (-[^ ]),\ (--.*)$ ]] && line="  ${BASH_REMATCH[1]},${BASH_REMATCH[2]}"
        # The type follows the names after one space, descriptions after more or on the next line.
        [[ $line =~ ^\ \ (-[^ ]+)(\ ([^ ]+))? ]] || continue
        names=${BASH_REMATCH[1]%%\{*}
        type=${BASH_REMATCH[3]}
        case $type in REQUIRED | Needs: | Excludes: | Env:* | '[='*) type= ;; esac
        for name in ${names//,/ }; do
            options[$name]=$type
        done
    done <<<"${_raystage_help_texts[$key]}"
}

_raystage() {
    local cur prev words cword split
    _init_completion -s || return
    local -a commands
    local -A options
    local -a run=("${words[0]/#\~/$HOME}")
    local i
    _raystage_read_help "${run[@]}"
    for ((i = 1; i < cword && ${#commands[@]}; i++)); do
        if [[ " ${commands[*]} " == *" ${words[i]} "* ]]; then
            run+=("${words[i]}")
            _raystage_read_help "${run[@]}"
        fi
    done

    local type=
    [[ $prev == -* ]] && type=${options[$prev]-}
    if [[ -n $type ]]; then
        if [[ $type =~ \{([^}]*)\} ]]; then
            COMPREPLY=($(compgen -W "${BASH_REMATCH[1]//,/ }" -- "$cur"))
        elif [[ ${type%%=*} =~ ^[a-z0-9_-]+(\|[a-z0-9_-]+)+$ ]]; then
            type=${type%%=*}
            COMPREPLY=($(compgen -W "${type//|/ }" -- "$cur"))
        elif [[ ! $type =~ ^([A-Z,.]+:)?(INT|UINT|FLOAT|POSITIVE|NONNEGATIVE)(=|$|:) ]]; then
            _filedir
        fi
        return
    fi
    [[ $split == true ]] && return
    if [[ $cur == -* ]]; then
        COMPREPLY=($(compgen -W "${!options[*]}" -- "$cur"))
    elif ((${#commands[@]})); then
        COMPREPLY=($(compgen -W "${commands[*]}" -- "$cur"))
    else
        _filedir
    fi
} && complete -F _raystage raystage
