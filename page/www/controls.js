// Makes the controls of the options from the table of the plotter's library.

/** The value of the choice that shows a field for another value. */
const OTHER = "\u2026";

/** Whether a form of a value has a placeholder in capitals. */
const isFree = (form) => /[A-Z]/.test(form);

export class Controls {
  /** `table` and `pages` come from the library; `onchange` gets a name and a value, or null. */
  constructor(form, table, pages, onchange) {
    this.rows = new Map();
    this.onchange = onchange;
    form.addEventListener("submit", (event) => event.preventDefault());
    const groups = new Map();
    for (const option of table) {
      if (!groups.has(option.heading)) {
        const group = form.appendChild(document.createElement("fieldset"));
        group.appendChild(document.createElement("legend")).textContent = option.heading;
        groups.set(option.heading, group);
      }
      groups.get(option.heading).append(this.row(option, pages));
    }
  }

  row(option, pages) {
    const row = element("div", { className: "control" });
    const id = `option-${option.name}`;
    row.append(element("label", { htmlFor: id, textContent: option.name }));
    const fields = row.appendChild(element("div", { className: "fields" }));
    const hint = element("p", { className: "hint", id: `${id}-hint`, textContent: option.help });
    const problem = element("p", { className: "problem", id: `${id}-problem`, hidden: true });
    const parts = { option, problem };
    const words = option.values.filter((form) => !isFree(form));
    const named =
      option.name === "page" ? pages.map(([name, value]) => [value, name.toUpperCase()]) : [];
    const choices = named.length
      ? named
      : words.map((word, at) => [word, word, option.choices[at]]);
    if (option.is_switch) {
      parts.box = fields.appendChild(element("input", { type: "checkbox", id }));
      parts.box.addEventListener("change", () =>
        this.onchange(option.name, parts.box.checked ? "on" : null),
      );
    } else {
      const free = option.values.some(isFree);
      if (choices.length) {
        parts.choice = fields.appendChild(element("select", { id }));
        // What is not chosen by default can be so again.
        if (option.default === null)
          parts.choice.append(element("option", { value: "", textContent: option.unset ?? "–" }));
        for (const [value, label, meaning] of choices) {
          const text = meaning
            ? `${label}: ${meaning.charAt(0).toLowerCase()}${meaning.slice(1)}`
            : label;
          parts.choice.append(element("option", { value, textContent: text }));
        }
        if (free) parts.choice.append(element("option", { value: OTHER, textContent: "other…" }));
        parts.choice.addEventListener("change", () => {
          const value = parts.choice.value;
          if (parts.text) parts.text.hidden = value !== OTHER;
          if (value === OTHER) parts.text.focus();
          else this.onchange(option.name, value === (option.default ?? "") ? null : value);
        });
      }
      if (free) {
        const placeholder =
          option.default ?? option.unset ?? option.values.filter(isFree).join(" or ");
        const type = [
          "text",
          { id: choices.length ? `${id}-text` : id, placeholder, spellcheck: false },
        ];
        parts.text = fields.appendChild(element("input", { type: type[0], ...type[1] }));
        parts.text.setAttribute(
          "aria-label",
          `${option.name}: ${option.values.filter(isFree).join(" or ")}`,
        );
        parts.text.hidden = choices.length > 0;
        parts.text.addEventListener("change", () => {
          const value = parts.text.value.trim();
          this.onchange(option.name, value === "" || value === option.default ? null : value);
        });
      }
    }
    for (const field of [parts.box, parts.choice, parts.text]) {
      field?.setAttribute("aria-describedby", `${hint.id} ${problem.id}`);
    }
    row.append(problem, hint);
    this.rows.set(option.name, parts);
    return row;
  }

  /** Shows these values: a map of those that are not the defaults. */
  show(values) {
    for (const [name, parts] of this.rows) {
      const { option, box, choice, text } = parts;
      const value = values.get(name) ?? option.default ?? "";
      if (box) box.checked = value === "on";
      if (choice) {
        const known = [...choice.options].some((own) => own.value === value);
        choice.value = known ? value : OTHER;
        if (text) text.hidden = known;
      }
      const inForce = values.get(name) ?? "";
      // What is being typed stays as long as the value in force does.
      const isTyped = document.activeElement === text && parts.shown === inForce;
      if (text && !isTyped) text.value = inForce;
      parts.shown = inForce;
    }
  }

  /** Says beside a control what is wrong with its value; without a name, takes all of that away. */
  problem(name, sentence) {
    for (const [own, { problem, text }] of this.rows) {
      const is = own === name;
      problem.hidden = !is;
      problem.textContent = is ? sentence : "";
      text?.setAttribute("aria-invalid", String(is));
    }
  }
}

function element(name, properties) {
  return Object.assign(document.createElement(name), properties);
}
