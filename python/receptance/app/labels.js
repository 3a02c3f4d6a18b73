// Names and keys that Bokeh's widgets lack. Parts that are made later are named when they appear.
const moves = { "+": [0.1, -0.1], "-": [-0.125, 0.125], ArrowLeft: [-0.1, -0.1], ArrowRight: [0.1, 0.1] };
const label = (view, plot) => {
  const root = view.shadow_el, model = view.model;
  if (model.x_range) plot = model;
  const name = String(model.title?.text || model.title || model.name || plot?.title?.text || plot?.name || "curves");
  const each = (selector, call) => root?.querySelectorAll(selector).forEach(call);
  each("[role=slider]", handle => {
    handle.setAttribute("aria-label", name); handle.setAttribute("aria-valuetext", model.tags[0] ?? String(model.value)); });
  each("input[type=checkbox]", box => box.closest("label") || box.setAttribute("aria-label", model.name || model.label));
  each("input.choices__input", input => { input.setAttribute("aria-label", name); input.removeAttribute("role"); });
  each(".choices__list--multiple > *", item => item.removeAttribute("aria-selected"));
  each("canvas", canvas => { canvas.setAttribute("role", "img"); canvas.setAttribute("aria-label", name); });
  each(".bk-events", area => {  // a figure that has the focus is zoomed by + and -, moved by arrows, reset by 0
    area.setAttribute("role", "group"); area.setAttribute("aria-label", `zoom ${name}`);
    area.setAttribute("aria-keyshortcuts", "+ - ArrowLeft ArrowRight 0");
    area.onkeydown = event => {
      const range = plot?.x_range, ends = moves[event.key], width = range?.end - range?.start;
      if (!range || event.ctrlKey || event.altKey || event.metaKey) return;
      if (event.key == "0") range.reset();
      else if (ends) range.setv({ start: range.start + ends[0] * width, end: range.end + ends[1] * width });
      else return;
      event.preventDefault(); } });
  each(".bk-spin-btn", button =>
    button.setAttribute("aria-label", `${name}, ${button.classList.contains("bk-spin-btn-up") ? "more" : "less"}`));
  if (model.tags.includes("hover")) each("label", (item, index) => {
    item.onmouseenter = () => { model.active = index; }; });
  each(".bk-header", header => header.setAttribute("role", "tablist"));
  each(".bk-tab", tab => {
    tab.setAttribute("role", "tab"); tab.setAttribute("aria-selected", tab.classList.contains("bk-active"));
    tab.onkeydown = event => {
      if (event.key == "Enter" || event.key == " ") { event.preventDefault(); tab.click(); }
      const next = { ArrowRight: tab.nextElementSibling, ArrowLeft: tab.previousElementSibling }[event.key];
      if (next) { next.focus(); next.click(); } } });
  if (root && !view.is_watched) {
    view.is_watched = true;
    const again = () => requestAnimationFrame(() => label(view, plot));
    new MutationObserver(again).observe(root, { childList: true, subtree: true });
    model.properties.tags.change.connect(again); }
  for (const child of [...view.child_views ?? [], view.canvas_view ?? [], ...view._tool_views?.values?.() ?? []].flat())
    label(child, plot);
};
const all = () => { for (const view of Object.values(Bokeh.index.roots ?? Bokeh.index)) label(view); };
all(); setTimeout(all, 300);
