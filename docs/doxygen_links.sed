# Links to files that are no page of the site become their text.
s#(^|[^!])\[([^]]*)\]\([^):]*\.(cpp|h|txt|sh|py|sbatch|svg|cff)\)#\1\2#g
s#(^|[^!])\[([^]]*)\]\(((\.\./)*src/dkb/?|LICENSE)\)#\1\2#g
