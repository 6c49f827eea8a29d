"""One stride of the template: its phases' motion and where their guards fire."""
