"""Additions to viser's page by a script and a style: keys, names of controls, and contrast."""

import html

# An arrow key moves the focused slider; viser would also turn the view. Arrow and page keys press the buttons
# that nudge along the first three axes; a key without a button turns the view. A plot that is made before it
# has a width never labels its time axis, so the script redraws it. Sliders and icons of viser have no names.
_SCRIPT = """
document.body.addEventListener('keydown', e => {
  const t = e.target, role = t.getAttribute('role');
  if (role === 'slider') e.stopPropagation();
  const k = ['ArrowLeft', 'ArrowRight', 'ArrowDown', 'ArrowUp', 'PageDown', 'PageUp'].indexOf(e.key);
  if (k < 0 || e.ctrlKey || e.altKey || e.metaKey || role || /^(INPUT|TEXTAREA)$/.test(t.tagName)) return;
  const b = [...document.querySelectorAll('button')].filter(b => /^[−+]r?[xyz]$/.test(b.innerText.trim()));
  if (b[k]) { e.stopPropagation(); e.preventDefault(); b[k].click(); }
});
const icons = {'list-search': 'Commands', adjustments: 'Configuration'};
setInterval(() => {
  for (const {chart: c} of Object.values(window.__viserTestpoints?.uplots ?? {}))
    if (c.width > 0 && !c.axes[0]._found?.[1]) c.redraw(false, true);
  for (const e of document.querySelectorAll('[role=slider],input:not([type=hidden]),button')) {
    if (e.getAttribute('aria-label') || e.labels?.length || e.innerText.trim()) continue;
    const icon = e.querySelector('svg')?.getAttribute('class')?.match(/tabler-icon-([a-z-]+)/)?.[1];
    const labels = e.closest('div:has(label)')?.querySelectorAll('label');
    const name = labels?.length === 1 ? labels[0].innerText : '';
    e.setAttribute('aria-label', e.tagName === 'BUTTON' ? icons[icon] ?? 'Close' : name);
  }
  document.getElementById('root').setAttribute('role', 'main');
}, 500);
"""
# Labels of viser have a contrast of 3.3 and 4.0, its blue of 3.6; WCAG asks for 4.5. On its dark gray some
# colors of `rmrc.show.palette` have 2.5; on this black all have the 3 that they are made for.
_STYLE = """
:root[data-mantine-color-scheme=light] {
  --mantine-color-dimmed: #5a6169 !important;
  --mantine-color-blue-6: #1971c2 !important;
}
:root[data-mantine-color-scheme=dark] {
  --mantine-color-dimmed: #b0b0b0 !important;
  --mantine-color-body: #0d1011 !important;
}
"""
_HIDDEN = "position:absolute;width:1px;height:1px;margin:0;overflow:hidden;clip-path:inset(50%)"
# The page may make this element again: the script runs once.
EXTRAS = (
    f'<h1 style="{_HIDDEN}">rmrc explore</h1><style>{_STYLE}</style><img hidden alt="" src="data:," '
    f'onerror="{html.escape(f"if(!window.rmrc){{window.rmrc=1;{_SCRIPT}}}")}">'
)
