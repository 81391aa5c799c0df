"""Parts of all pages: fields, buttons, menus, icons, dialogs, work in threads."""
