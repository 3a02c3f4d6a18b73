const label = view => {
  const root = view.shadow_el, name = view.model.title?.text || view.model.title || view.model.name || "curves";
  root?.querySelectorAll("[role=slider]").forEach(handle => {
    handle.setAttribute("aria-label", String(name)); handle.setAttribute("aria-valuetext", String(view.model.value)); });
  root?.querySelectorAll("canvas").forEach(canvas => {
    canvas.setAttribute("role", "img"); canvas.setAttribute("aria-label", String(name)); });
  root?.querySelectorAll(".bk-spin-btn").forEach(button =>
    button.setAttribute("aria-label", `${name}, ${button.classList.contains("bk-spin-btn-up") ? "more" : "less"}`));
  if (view.model.tags?.includes("hover")) root?.querySelectorAll("label").forEach((item, index) => {
    item.onmouseenter = () => { view.model.active = index; }; });
  root?.querySelectorAll(".bk-header").forEach(header => header.setAttribute("role", "tablist"));
  root?.querySelectorAll(".bk-tab").forEach(tab => {
    tab.setAttribute("role", "tab"); tab.setAttribute("aria-selected", tab.classList.contains("bk-active"));
    tab.onkeydown = event => {
      if (event.key == "Enter" || event.key == " ") { event.preventDefault(); tab.click(); }
      const next = { ArrowRight: tab.nextElementSibling, ArrowLeft: tab.previousElementSibling }[event.key];
      if (next) { next.focus(); next.click(); } } });
  for (const child of view.child_views ?? []) label(child);
  for (const child of view._tool_views?.values?.() ?? []) label(child);
};
const all = () => { for (const view of Object.values(Bokeh.index.roots ?? Bokeh.index)) label(view); };
all(); setTimeout(all, 300);
