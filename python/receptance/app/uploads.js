const guard = view => {
  const input = view.shadow_el?.querySelector("input[type=file]");
  if (input && !input.dataset.guarded) {
    input.dataset.guarded = "yes";
    view.shadow_el.addEventListener("change", event => {
      const size = [...input.files].reduce((sum, file) => sum + file.size, 0);
      input.setCustomValidity("");
      if (size > limit) {
        event.stopImmediatePropagation(); input.value = "";
        input.setCustomValidity(`The files have ${Math.ceil(size / 2 ** 20)} MiB, expected at most ${limit / 2 ** 20} MiB ` +
          "together; copy them into the folder, and choose them.");
        input.reportValidity(); } }, true); }
  for (const child of view.child_views ?? []) guard(child);
};
for (const view of Object.values(Bokeh.index.roots ?? Bokeh.index)) guard(view);
