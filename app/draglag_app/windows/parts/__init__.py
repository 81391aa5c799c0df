"""What every page is made of: fields, buttons, menus, icons, dialogs, work beside the window. Nothing here measures."""
