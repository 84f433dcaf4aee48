"""Writes the synthetic ratings of graphs/assets/material/synthetic_ratings.csv and prints SciPy's statistics of them.

Nobody listened: ratings are normal numbers with the means and standard deviations of the paper's table 2, rounded to 1 to 11.

    python3 nodes/tests/oracles/ratings.py graphs/assets/material/synthetic_ratings.csv
"""

import sys

import numpy as np
from scipy import stats

TABLE_2 = {"Rayleigh": [(6.8, 3.0), (5.1, 3.0)], "Hybrid": [(6.7, 3.0), (5.4, 3.3)], "Ren": [(6.0, 3.0), (3.5, 2.7)]}

rng = np.random.default_rng(26)
rows, same = [], []
for name, groups in TABLE_2.items():
    drawn = [np.clip(np.round(rng.normal(mean, sd, n)), 1, 11) for (mean, sd), n in zip(groups, (40, 80))]
    rows += [(name, pair, int(r)) for pair, ratings in zip(("same", "different"), drawn) for r in ratings]
    a, b = drawn
    same.append(a)
    test = stats.ttest_ind(a, b, equal_var=False)
    pooled = np.sqrt(((len(a) - 1) * a.var(ddof=1) + (len(b) - 1) * b.var(ddof=1)) / (len(a) + len(b) - 2))
    print(name, repr(test.statistic), repr(test.df), repr(test.pvalue), repr((a.mean() - b.mean()) / pooled))
print("anova", *map(repr, stats.f_oneway(*same)))
with open(sys.argv[1], "w") as f:
    f.write("# Synthetic: nobody listened. Drawn by nodes/tests/oracles/ratings.py from the means of the paper's table 2.\n")
    f.write("subject,set,pair,rating\n")
    for k, (name, pair, rating) in enumerate(rows):
        f.write(f"{k % 20 + 1},{name},{pair},{rating}\n")
