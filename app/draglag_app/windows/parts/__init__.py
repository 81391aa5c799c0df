"""What every page is made of: fields, buttons, menus, icons, dialogs, work in threads. Nothing here measures."""
