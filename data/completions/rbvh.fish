# Completion of rbvh for fish: stages and options are read off the tool's own help.
function __rbvh_stages
    rbvh --help 2>/dev/null | sed -n '/^Subcommands:/,/^$/s/^  \([a-z]\{1,\}\)  *\(.*\)/\1\t\2/p'
end
function __rbvh_options
    set -l words (commandline -opc)
    rbvh $words[2] --help 2>/dev/null | sed -n 's/^  \(-[^ ]*\).*/\1/p' | tr , '\n'
end
complete -c rbvh -n __fish_use_subcommand -f -a '(__rbvh_stages)'
complete -c rbvh -n 'not __fish_use_subcommand; and string match -q -- "-*" (commandline -ct)' -f -a '(__rbvh_options)'
