# The pictures of the documents, made by the program itself: `make figures`.
# A line a picture, plain enough to be copied; what else a command leaves goes to build/figures.

PYTHON ?= .venv/bin/python

.PHONY: figures films
figures:
	$(PYTHON) -m rmrc workspace models/planar_6_3.xml --picture docs/figures/workspace_6_3.png --out build/figures --quiet
	$(PYTHON) -m rmrc workspace models/planar_6_3.xml --map sigma_min --picture docs/figures/sigma_min_6_3.png --out build/figures --quiet
	$(PYTHON) -m rmrc workspace models/torus_3r.xml --picture docs/figures/workspace_torus.png --out build/figures --quiet
	$(PYTHON) -m rmrc workspace models/torus_3r_short.xml --map sigma_min --picture docs/figures/sigma_min_torus.png --out build/figures --quiet
	$(PYTHON) -m rmrc workspace models/stanford.xml --over theta_2,theta_5 --site wrist --picture docs/figures/wrist_stanford.png --out build/figures --quiet
	$(PYTHON) -m rmrc inspect models/planar_2link.xml --q "80 deg,-160 deg" --q "60 deg,-120 deg" --q "30 deg,-60 deg" --q "10 deg,-20 deg" --picture docs/figures/ellipses_along_a_reach.png
	$(PYTHON) -m rmrc inspect models/puma560.xml --picture docs/figures/ellipses_puma.png
	$(PYTHON) tools/small_displacements.py docs/figures/small_displacements.png
	$(PYTHON) -m rmrc identify scenarios/arm_log.csv --picture docs/figures/identify_arm_log.png --out build/figures --quiet
	$(PYTHON) -m rmrc tune scenarios/approach_singularity.yaml --set "target.path[0].line.to=[1.995, 0]" --picture docs/figures/front_approach_singularity.png --out build/figures --quiet

# Those that need OpenGL.
films:
	$(PYTHON) -m rmrc render blow_up --vary control.inverse.method=inverse,damped -o docs/figures/blow_up.gif --fps 12.5 --size 840x430
	$(PYTHON) tools/gallery.py --write

# The site of the documents, into docs/_site, for browsers without a network: `make docs`, `make docs VERSIONS="main v1.0"`.
.PHONY: docs links
docs:
	$(PYTHON) tools/site.py $(VERSIONS)

# External links of the documents, over the network.
links:
	$(PYTHON) tools/site.py --external
