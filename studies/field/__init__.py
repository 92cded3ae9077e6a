"""Field cases: what people really log and what really happens to their robots, as logs with known truth and a judge.

A case writes one log folder, says what is true of it, and which endings a field engineer would accept: the right
constants, a doubt that names the matter, or a refusal that names what lies there. The *known* cases rebuild situations
that were seen in public; the *further* ones are of the same kinds, with other makers, units, sizes and moments.

    python -m studies field                      all cases, one table
    python -m studies field --only wheels-rpm    some of them, by name or number
"""
